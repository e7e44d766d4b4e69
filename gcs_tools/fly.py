"""`gcs fly`: a plan flown over UDP by a vehicle that runs somewhere else."""

import contextlib
import sys
from collections.abc import Callable
from pathlib import Path

from gcs_tools import results
from gcs_tools.client import Client, LinkError
from gcs_tools.flight import Flight
from gcs_tools.impairment import GOOD, Impairment
from gcs_tools.link import Connection, UdpLink
from gcs_tools.plan import Plan
from gcs_tools.progress import Progress
from gcs_tools.tlog_writer import TlogWriter
from sitl.mavlink.signing import Signer


def fly(
    plan: Plan,
    connection: Connection,
    *,
    system: int | None = None,
    signer: Signer | None = None,
    impairment: Impairment = GOOD,
    out: Path | None = None,
    as_json: bool = False,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Fly, measure and tell the result. `check` is called often, to raise what else may have gone wrong.

    Raises LinkError when it wasn't flown to its end, ConfigError when `out` can't be written. A flight that ran its
    whole time is measured and told even if the landing behind it went wrong.
    """
    results.prepare(out)
    client = Client(system, signer)
    flight = Flight(plan, client)
    fault: LinkError | None = None
    with contextlib.ExitStack() as stack:
        tap = None
        if out is not None:
            tap = TlogWriter(stack.enter_context((out / "flight.tlog").open("wb"))).take
        link = stack.enter_context(UdpLink(connection, impairment, tap))
        try:
            with Progress(flight, quiet=as_json) as progress:

                def each_turn(wall_s: float) -> None:
                    check()
                    progress.update(wall_s)

                link.run(client, each_turn)
        except LinkError as error:
            fault = error
        except KeyboardInterrupt:
            flight.give_up()
            link.flush(client)
            print("\n".join(("", *flight.notes)) if flight.notes else "", file=sys.stderr)
            raise
    if flight.measured_s is not None:
        began_s, ended_s = flight.wall_s
        factor = flight.measured_s / max(ended_s - began_s, 1e-9)
        results.conclude(flight, vehicle=client.vehicle.name, factor=factor, out=out, as_json=as_json)
    if fault is not None:
        raise LinkError(f"{plan.name}: {fault}")
