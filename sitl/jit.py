"""The one decorator of compiled code, and where its compiled form is kept between runs.

Numba notices a change in a function's own file but not in the files of what it calls, so an edited force law could
go on running in its old form inside a cached caller. The cache folder is therefore named by a digest of all kernel
sources (files with kernels, and what they import): any edit there starts a fresh one. It lives in the user's cache
folder ($NUMBA_CACHE_DIR, $XDG_CACHE_HOME or ~/.cache), never in the installed package, which may be read-only.

With NUMBA_DISABLE_JIT=1 the same sources run as plain Python, for debuggers and coverage.
"""

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

_KEPT = 3  # cache folders of other versions that stay, newest first
_SOURCES = Path(__file__).parent
_IMPORT = re.compile(rb"^from sitl\.([\w.]+) import", re.MULTILINE)


def _cache_root() -> Path:
    base = os.environ.get("NUMBA_CACHE_DIR")
    if base:
        return Path(base)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "yawsitter"


def _digest() -> str:
    paths = [path for folder in ("", "model", "control", "estimation") for path in (_SOURCES / folder).glob("*.py")]
    found = {path: source for path in paths if b"\n@kernel\n" in (source := path.read_bytes())}
    sources = list(found.values())
    while sources:
        for name in _IMPORT.findall(sources.pop()):
            path = _SOURCES / f"{name.decode().replace('.', '/')}.py"
            if path not in found and path.is_file():
                found[path] = path.read_bytes()
                sources.append(found[path])
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(found):
        digest.update(path.name.encode() + found[path])
    return digest.hexdigest()[:16]


def _use_cache() -> None:
    root = _cache_root()
    folder = root / f"kernels-{_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        others = sorted(root.glob("kernels-*"), key=lambda f: f.stat().st_mtime, reverse=True)
        for stale in others[_KEPT + 1 :]:
            shutil.rmtree(stale, ignore_errors=True)
    except OSError:
        return  # no cache folder: numba falls back to its own choice of place
    numba.config.CACHE_DIR = str(folder)


_use_cache()


def kernel(function: F) -> F:
    """Compile to machine code on first call: cached on disk, GIL released, no fast-math (results repeat bit for bit).

    Division by zero follows IEEE 754 there instead of raising. What one kernel calls of others becomes part of it: a
    call would pass every tuple through memory, which cost a control step a tenth of its time.
    """
    compiled: F = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function)
    return compiled
