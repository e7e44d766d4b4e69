"""Fly a swarm in formation through the one port that its vehicles share.

    sitl swarm 9                                     # leave it running
    python examples/formation.py v                   # in another terminal: a V that flies a rectangle
    python examples/formation.py circle              # all on one circle, evenly spaced, one lap

`--connect`, `--first` and `--count` name another swarm. Each vehicle is told only its own targets, in its own frame
(its origin is where it stood at the start); all are on one clock, so one start time is all that keeps them together.
Prints how far each was from its place while the formation flew.
"""

import argparse
import math
from collections.abc import Callable

from gcs_tools.client import Client, LinkError, Script
from gcs_tools.fleet import Fleet
from gcs_tools.link import UdpLink, parse_connection
from gcs_tools.reference import Setpoint, TimedPoint, Vector, Waypoints, minimum_jerk
from sitl.geodesy import GeoPoint, to_local
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

HEIGHT_M = 3.0
CLIMB_S, JOIN_S, FLY_S = 4.0, 12.0, 36.0  # until it hovers above where it stood, is in its place, has flown
BACK_S = 44.0
STREAM_S = 0.05  # of the vehicles' time between targets
LEAD_S = 1.0  # from the last arming to the start
LEGS = ((0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (0.0, 6.0), (0.0, 0.0))  # north, east [m] of the V's rectangle
HERE = (math.nan,) * 4
_TARGET = codec.by_name("SET_POSITION_TARGET_LOCAL_NED")
_IGNORE_YAW_RATE = 1 << 11

Shape = Callable[[int, int, float], Setpoint]  # number, how many, seconds since all are in place; in one frame for all


def v(number: int, count: int, t: float) -> Setpoint:
    """The first ahead, the others in turns behind it on the left and the right; all fly the legs alike."""
    row, side = (number + 1) // 2, 1 if number % 2 else -1
    back, beside = -3.0 * row, 3.0 * row * side
    each_s = (FLY_S - JOIN_S) / (len(LEGS) - 1)
    legs = [TimedPoint(k * each_s, (back + n, beside + e, -HEIGHT_M)) for k, (n, e) in enumerate(LEGS)]
    return Waypoints(legs).at(t)


def circle(number: int, count: int, t: float) -> Setpoint:
    """One lap, the vehicles evenly spaced, at least two metres apart."""
    radius_m, span_s = max(3.0, count / math.pi), FLY_S - JOIN_S
    s, speed, acceleration = minimum_jerk(min(1.0, max(0.0, t / span_s)))
    turn = 2.0 * math.pi
    angle, w, a = turn * (s + number / count), turn * speed / span_s, turn * acceleration / span_s**2
    x, y = radius_m * math.cos(angle), radius_m * math.sin(angle)
    return Setpoint((x, y, -HEIGHT_M), (-w * y, w * x, 0.0), (-a * y - w * w * x, a * x - w * w * y, 0.0))


class Formation:
    """All vehicles, and what they have in common: where each stands, and when they start."""

    def __init__(self, shape: Shape, systems: range) -> None:
        self.shape, self.t0_s = shape, math.inf
        self.members = [Member(self, number, Client(system)) for number, system in enumerate(systems)]

    def origin(self) -> GeoPoint | None:
        """Of the frame that the shape is in: where the first vehicle stands."""
        return self.members[0].origin

    def start_when_ready(self, now_s: float) -> None:
        if math.isinf(self.t0_s) and all(member.ready for member in self.members):
            self.t0_s = now_s + LEAD_S


class Member:
    """One vehicle's part."""

    def __init__(self, formation: Formation, number: int, client: Client) -> None:
        self.formation, self.number, self.client = formation, number, client
        self.origin: GeoPoint | None = None
        self.ready = False
        self.away_m: list[float] = []  # from its place, while the formation flies
        self._next_s = 0.0
        client.on["GPS_GLOBAL_ORIGIN"] = self._told_origin
        client.on["LOCAL_POSITION_NED"] = self._told_position
        client.start(self._script())

    def _told_origin(self, m) -> None:
        self.origin = GeoPoint(m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3)

    def _told_position(self, m) -> None:
        t = m.time_boot_ms * 1e-3 - self.formation.t0_s
        if JOIN_S <= t <= FLY_S:
            self.away_m.append(math.dist((m.x, m.y, m.z), self.target(t).position_m))

    def target(self, t: float) -> Setpoint:
        """Where it should be, in its own frame."""
        if t <= CLIMB_S or t >= BACK_S:
            return Waypoints([TimedPoint(0.0, (0.0, 0.0, 0.0)), TimedPoint(CLIMB_S, (0.0, 0.0, -HEIGHT_M))]).at(t)
        first, own = self.formation.origin(), self.origin
        assert first is not None
        assert own is not None
        north, east = to_local(first, own.lat_deg, own.lon_deg)

        def in_place(t: float) -> Setpoint:
            x, v, a = self.formation.shape(self.number, len(self.formation.members), t - JOIN_S)
            return Setpoint((x[0] - north, x[1] - east, x[2]), v, a)

        above: Vector = (0.0, 0.0, -HEIGHT_M)
        if t < JOIN_S:
            return Waypoints([TimedPoint(CLIMB_S, above), TimedPoint(JOIN_S, in_place(JOIN_S).position_m)]).at(t)
        if t > FLY_S:
            return Waypoints([TimedPoint(FLY_S, in_place(FLY_S).position_m), TimedPoint(BACK_S, above)]).at(t)
        return in_place(t)

    def _script(self) -> Script[None]:
        client, vehicle, formation = self.client, self.client.vehicle, self.formation
        yield from client.connect()
        client.request("GPS_GLOBAL_ORIGIN")
        known = "it tells no position, time or origin"
        yield from client.wait(lambda: self.origin is not None and vehicle.clock.known, 10.0, known)
        yield from client.wait(lambda: all(m.origin for m in formation.members), 30.0, "others are not heard")
        client.background = self._stream
        yield from client.set_mode("offboard", patience_s=5.0)
        yield from client.arm(8.0)
        self.ready = True
        yield from client.wait(lambda: math.isfinite(formation.t0_s), 60.0, "others are not ready")
        while self._time_s() < BACK_S:
            if not vehicle.armed or vehicle.mode != "offboard":
                raise LinkError(f"left the formation: {vehicle.mode}, {vehicle.reasons_since(client.wall_s - 3.0)}")
            yield math.inf
        yield from client.require("landing", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, *HERE)
        client.background = None
        yield from client.wait(lambda: not vehicle.armed, 60.0, "it does not land")

    def _time_s(self) -> float:
        """Of the formation's flight; before its start far below zero."""
        return self.client.vehicle.clock.at(self.client.wall_s) - self.formation.t0_s

    def _stream(self) -> float:
        client, clock = self.client, self.client.vehicle.clock
        now_s = clock.at(client.wall_s)
        self.formation.start_when_ready(now_s)
        if now_s >= self._next_s:
            self._next_s = max(self._next_s + STREAM_S, now_s)
            stamp_ms = round(now_s * 1e3)
            position, velocity, acceleration = self.target(stamp_ms * 1e-3 - self.formation.t0_s)
            where = client.system or 0, mav.MAV_COMP_ID_AUTOPILOT1, mav.MAV_FRAME_LOCAL_NED
            target = (*position, *velocity, *acceleration, 0.0, 0.0, _IGNORE_YAW_RATE, *where)
            client.send_packed(_TARGET, _TARGET.pack(stamp_ms, *target))
        return clock.when(self._next_s)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shape", choices=("v", "circle"))
    parser.add_argument("--connect", type=parse_connection, default="udpout:127.0.0.1:18300", help="the shared port")
    parser.add_argument("--first", type=int, default=1, metavar="ID", help="system id of the first vehicle (1)")
    parser.add_argument("--count", type=int, default=9, metavar="N", help="how many vehicles (9)")
    args = parser.parse_args(arguments)
    formation = Formation({"v": v, "circle": circle}[args.shape], range(args.first, args.first + args.count))
    with UdpLink(args.connect) as link:
        link.run(Fleet(member.client for member in formation.members))
    print("vehicle   mean   worst distance from its place [m]")
    for member in formation.members:
        print(f"{member.client.system:7} {sum(member.away_m) / len(member.away_m):6.3f}  {max(member.away_m):6.3f}")


if __name__ == "__main__":
    try:
        main()
    except LinkError as fault:
        raise SystemExit(f"formation: {fault}") from None
