"""`python -m benchmarks.peer_environments [NAME …]`: install the other simulators that `peers` flies in turn with this.

It downloads, so it is done only when asked for. Each gets an environment of its own under $XDG_CACHE_HOME (~/.cache),
yawsitter/peers, with the versions named here, never among the project's dependencies; deleting the folder undoes it.
"""

import argparse
import os
import subprocess
import sys
import venv
from pathlib import Path
from typing import NamedTuple


class Environment(NamedTuple):
    packages: tuple[str, ...]
    size: str  # on disk


ENVIRONMENTS = {
    "jsbsim": Environment(("jsbsim==1.3.3",), "0.1 GB"),
    "rotorpy": Environment(("rotorpy==3.0.0",), "0.5 GB"),
    "pyflyt": Environment(("PyFlyt==0.29.0",), "0.8 GB"),
    "udaan": Environment(("udaan==1.3.0",), "0.9 GB"),
    "crazyflow": Environment(("crazyflow==0.4.0", "jax==0.10.1"), "1.2 GB"),
    "rotorpy-batch": Environment(("rotorpy[batched]==3.0.0", "torch==2.14.1"), "5.9 GB: pip's torch brings CUDA"),
}
_INSTALLED = "installed.txt"  # what an environment was made with, once it is whole


def python_of(name: str) -> Path | None:
    """The interpreter of an environment; None where it is not there with these very versions."""
    folder = _folder(name)
    try:
        whole = (folder / _INSTALLED).read_text().split() == list(ENVIRONMENTS[name].packages)
    except FileNotFoundError:
        return None
    return _python(folder) if whole else None


def hint(name: str) -> str:
    """How a user gets it."""
    return f"not installed: python -m benchmarks.peer_environments {name} ({ENVIRONMENTS[name].size})"


def install(name: str) -> None:
    """Make an environment, anew if there is one. Raises CalledProcessError where pip can't install it."""
    folder, packages = _folder(name), ENVIRONMENTS[name].packages
    venv.create(folder, clear=True, with_pip=True)
    pip = (str(_python(folder)), "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    subprocess.run([*pip, *packages], check=True)
    (folder / _INSTALLED).write_text("\n".join(packages) + "\n")


def _folder(name: str) -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "yawsitter" / "peers" / name


def _python(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def main() -> int:
    listing = "\n".join(f"  {name:<15}{' '.join(e.packages)} ({e.size})" for name, e in ENVIRONMENTS.items())
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.peer_environments",
        description="Install the simulators that `python -m benchmarks peers` flies in turn with this one.",
        epilog=f"environments:\n{listing}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="these alone (all)")
    names = parser.parse_args().names
    if unknown := set(names) - set(ENVIRONMENTS):
        parser.error(f"no environment is called {', '.join(sorted(unknown))}: there are {', '.join(ENVIRONMENTS)}")
    failed = False
    for name in names or ENVIRONMENTS:
        if python_of(name) is not None:
            print(f"{name}: there already, in {_folder(name)}")
            continue
        try:
            install(name)
        except subprocess.CalledProcessError as error:
            failed = True
            print(f"{name}: pip could not install {' '.join(ENVIRONMENTS[name].packages)} ({error.returncode})")
        else:
            print(f"{name}: installed in {_folder(name)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
