"""`sitl campaign`: read a campaign, fly what is not flown yet, report."""

import argparse
import json
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

from sitl.campaign import file, report
from sitl.campaign.run import COPY, RECORD, StoppedError, fly, need, plan
from sitl.campaign.workers import WorkerError
from sitl.strict_yaml import ConfigError


def main(args: argparse.Namespace) -> int:
    """`sitl campaign` with its parsed arguments: the exit status."""
    return answered("campaign", _campaign, args)


def answered(command: str, do: Callable[[argparse.Namespace], None], args: argparse.Namespace) -> int:
    """Do it, and answer what goes wrong with one line.

    0 when all is flown and told, 1 when the workers gave up, 2 for what can't be used, 130 after Ctrl-C.
    """
    try:
        do(args)
    except WorkerError as error:
        return _complain(command, f"{error}; what was flown is kept: --resume goes on", 1)
    except StoppedError as told:
        return _complain(command, str(told), 130)
    except ConfigError as error:
        return _complain(command, str(error), 2)
    except OSError as error:
        return _complain(command, f"{error.filename or args.out}: {error.strerror or error}", 2)
    return 0


def _complain(command: str, message: str, code: int) -> int:
    print(f"sitl {command}: {message}", file=sys.stderr)
    return code


def _campaign(args: argparse.Namespace) -> None:
    need("pyarrow", "scipy", "matplotlib", extra="campaign")
    if args.report is not None:
        return _report(args.report, args.json)
    if args.cluster is not None:
        need("distributed", extra="cluster")
    if args.campaign is None:
        raise ConfigError("which campaign? Give its file, or --report DIR for one that is flown")
    campaign = file.load(str(args.campaign))
    folder = args.out or Path("out") / args.campaign.stem
    command = f"sitl campaign {shlex.quote(str(args.campaign))} --out {shlex.quote(str(folder))}"
    fly(plan(campaign, args.campaign.parent, folder, command), args)
    return _report(folder, args.json)


def _report(folder: Path, as_json: bool) -> None:
    if not (folder / RECORD).is_file():
        raise ConfigError(f"{folder}: holds no campaign")
    campaign = file.loads((folder / COPY).read_text(encoding="utf-8"), str(folder / COPY))
    record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    summary = report.write(folder, campaign, record)
    if as_json:
        print(json.dumps(summary))
    else:
        print(*report.told(summary), str(folder / "report.html"), sep="\n")
