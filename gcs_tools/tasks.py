"""What each `gcs` command does: a script of a Client, run over UDP, and its result printed."""

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gcs_tools import commands, logs, parameter_files, params
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.link import UdpLink, signer
from sitl.mavlink.signing import Signer
from sitl.strict_yaml import ConfigError


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError, LinkError, OSError, KeyboardInterrupt."""
    _TASKS[args.command](args)


def _signer(args: argparse.Namespace) -> Signer | None:
    return signer(args.signing_key) if args.signing_key is not None else None


def _client(args: argparse.Namespace) -> Client:
    return Client(args.system, _signer(args))


def _converse(
    args: argparse.Namespace,
    talk: Callable[[Client], Script[Any]],
    each_turn: Callable[[float], None] = lambda _wall_s: None,
) -> Any:
    client = _client(args)
    with UdpLink(args.connect, args.impair) as link:
        client.start(talk(client))
        try:
            link.run(client, each_turn)
        finally:
            client.stop(LinkError("interrupted"))
            link.flush(client)
    return client.result


def _fly(args: argparse.Namespace) -> None:
    from gcs_tools import plan
    from gcs_tools.fly import fly

    fly(
        plan.load(args.mission),
        args.connect,
        system=args.system,
        signer=_signer(args),
        impairment=args.impair,
        out=args.out,
        as_json=args.json,
    )


def _plan(args: argparse.Namespace) -> None:
    from gcs_tools import convert, plan, timeline

    found = plan.load(args.mission)
    if args.to is None:
        for objection in timeline.show(found):
            raise ConfigError(f"{args.mission}: {objection}")
        return
    written = convert.convert(found, args.to, args.home)
    counts = [f"{len(written.items)} items"]
    for name, items in (("fence", written.fence), ("rally points", written.rally)):
        counts += [f"{len(items)} of the {name}"] if items else []
    print(f"{', '.join(counts)} written to {args.to}")


def _param(args: argparse.Namespace) -> None:
    _PARAM_TASKS[args.action](args)


def _after_connecting(talk: Callable[[Client], Script[Any]]) -> Callable[[Client], Script[Any]]:
    def script(client: Client) -> Script[Any]:
        yield from client.connect()
        return (yield from talk(client))

    return script


def _param_list(args: argparse.Namespace) -> None:
    found = _converse(args, _after_connecting(params.fetch_all))
    chosen = {name: p for name, p in found.items() if name.startswith(args.prefix.upper())}
    if args.json:
        print(json.dumps({name: p.value for name, p in chosen.items()}))
        return
    for name, p in chosen.items():
        print(f"{name:<16}  {p.text}")


def _param_get(args: argparse.Namespace) -> None:
    print(_converse(args, _after_connecting(lambda c: params.fetch(c, args.name.upper()))).text)


def _param_set(args: argparse.Namespace) -> None:
    new = _converse(args, _after_connecting(lambda c: params.store(c, args.name.upper(), args.value)))
    print(f"{new.name} = {new.text}")


def _param_save(args: argparse.Namespace) -> None:
    def script(client: Client) -> Script[Any]:
        found = yield from params.fetch_all(client)
        return found, client.vehicle.name

    found, vehicle = _converse(args, _after_connecting(script))
    parameter_files.write(args.file, found, vehicle)
    print(f"{len(found)} parameters written to {args.file}")


def _param_load(args: argparse.Namespace) -> None:
    wanted = parameter_files.read(args.file)
    changed = _converse(args, _after_connecting(lambda c: parameter_files.apply(c, args.file, wanted)))
    for old, new in changed:
        print(f"{new.name} = {new.text} (was {old.text})")
    print(f"{len(changed)} of {len(wanted)} parameters changed")


def _log(args: argparse.Namespace) -> None:
    _LOG_TASKS[args.action](args)


def _log_list(args: argparse.Namespace) -> None:
    found = _converse(args, _after_connecting(logs.listed))
    if args.json:
        print(json.dumps([log._asdict() for log in found]))
        return
    for log in found:
        print(f"{log.number:>3}  {log.size:>12}  {log.label}")


def _log_get(args: argparse.Namespace) -> None:
    from gcs_tools.transfer_bar import TransferBar

    with TransferBar() as bar:

        def script(client: Client) -> Script[list[Path]]:
            paths = []
            for log in logs.chosen((yield from logs.listed(client)), args.log):
                paths.append((yield from logs.fetch(client, log, args.out, bar.show)))
            return paths

        paths = _converse(args, _after_connecting(script), bar.update)
    for path in paths:
        print(path)


def _log_erase(args: argparse.Namespace) -> None:
    print(f"{_converse(args, _after_connecting(logs.erase))} log files erased")


def _tune(args: argparse.Namespace) -> None:
    from gcs_tools.tune import command

    command.run(args)


def _watch(args: argparse.Namespace) -> None:
    from gcs_tools.watch.run import watch

    watch(args.connect, args.impair, args.system, _signer(args), args.seconds or math.inf)


def _view(args: argparse.Namespace) -> None:
    from gcs_tools.view.run import run as view

    view(args)


def _report(args: argparse.Namespace) -> None:
    from gcs_tools.report import main

    main.run(args)


def _say(make: Callable[[argparse.Namespace, Client], Script[str]]) -> Callable[[argparse.Namespace], None]:
    """A command whose script returns what to print."""
    return lambda args: print(_converse(args, lambda client: make(args, client)))


_PARAM_TASKS = {
    "list": _param_list,
    "get": _param_get,
    "set": _param_set,
    "save": _param_save,
    "load": _param_load,
}
_LOG_TASKS = {"list": _log_list, "get": _log_get, "erase": _log_erase}
_TASKS: dict[str, Callable[[argparse.Namespace], None]] = {
    "fly": _fly,
    "plan": _plan,
    "param": _param,
    "log": _log,
    "watch": _watch,
    "view": _view,
    "tune": _tune,
    "report": _report,
    "arm": _say(lambda args, client: commands.arm(client, force=args.force)),
    "disarm": _say(lambda args, client: commands.disarm(client, force=args.force)),
    "takeoff": _say(lambda args, client: commands.takeoff(client, height_m=args.height, wait=args.wait)),
    "land": _say(lambda args, client: commands.land(client, wait=args.wait)),
    "return": _say(lambda args, client: commands.return_home(client, wait=args.wait)),
    "hold": _say(lambda _args, client: commands.mode(client, "hold")),
    "mode": _say(lambda args, client: commands.mode(client, args.mode)),
}
