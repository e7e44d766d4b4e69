"""Whole vehicles in process, for the tests of what they decide."""

import math
from collections.abc import Callable

from sitl.onboard.events import EventLog
from sitl.onboard.mission_items import ItemCommand
from sitl.onboard.modes import Event, EventKind, Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.onboard.plan import Frame, MissionItem
from sitl.onboard.store import MemoryStore
from sitl.vehicle import Vehicle, load_vehicle

NAN = math.nan
SPECS = {name: load_vehicle(name) for name in ("yawsitter", "yawsitter-real")}
Watch = Callable[[Vehicle], None]


def standing(name: str = "yawsitter", **options) -> Vehicle:
    vehicle = Vehicle(SPECS[name], **options)
    vehicle.advance(100_000)
    return vehicle


def hovering(height_m: float = 3.0, name: str = "yawsitter", **options) -> Vehicle:
    vehicle = standing(name, **options)
    c = vehicle.commander
    assert c.takeoff(c.origin.alt_amsl_m + height_m).ok
    assert c.arm().ok
    wait(vehicle, lambda v: c.mode is Mode.HOLD, 60.0)
    after(vehicle, 1.0)
    return vehicle


def after(vehicle: Vehicle, seconds: float, watch: Watch | None = None) -> None:
    until = vehicle.now_us + round(seconds * 1e6)
    while vehicle.now_us < until:
        vehicle.advance(min(until, vehicle.now_us + (20_000 if watch else 500_000)))
        if watch:
            watch(vehicle)


def wait(vehicle: Vehicle, until: Callable[[Vehicle], bool], seconds: float) -> None:
    """Fly on until a condition holds; an AssertionError if it does not within so many seconds of flight."""
    limit = vehicle.now_us + round(seconds * 1e6)
    while not until(vehicle):
        assert vehicle.now_us < limit, f"not within {seconds} s: {vehicle.snapshot()}"
        vehicle.advance(vehicle.now_us + 100_000)


def stream(
    vehicle: Vehicle,
    target: OffboardTarget | Callable[[float], OffboardTarget],
    seconds: float,
    watch: Watch | None = None,
) -> None:
    """Targets at 50 Hz; of a function, at the time since the stream's start."""
    start = vehicle.now_us
    while vehicle.now_us - start < seconds * 1e6:
        t = (vehicle.now_us - start) * 1e-6
        assert vehicle.offboard.submit(target(t) if callable(target) else target, vehicle.now_us).ok
        vehicle.advance(vehicle.now_us + 20_000)
        if watch:
            watch(vehicle)


def place(vehicle: Vehicle) -> tuple[float, float, float]:
    s = vehicle.snapshot().truth
    return s.north_m, s.east_m, s.down_m


def texts(events: EventLog) -> list[str]:
    return [e.text for e in events.since(0) if e.kind is EventKind.TEXT]


def of_kind(vehicle: Vehicle, kind: EventKind, since: int = 0) -> list[Event]:
    return [e for e in vehicle.events.since(since) if e.kind is kind]


def reached(vehicle: Vehicle, since: int = 0) -> list[int]:
    return [e.value for e in of_kind(vehicle, EventKind.ITEM_REACHED, since)]


def item(
    command: ItemCommand,
    at: tuple[float, float, float] | None = None,
    p1: float = 0.0,
    p2: float = 0.0,
    p3: float = 0.0,
    p4: float = NAN,
    **fields,
) -> MissionItem:
    """A mission item; with `at` (north, east, down in m) in the local frame, else without a place."""
    if at is None:
        return MissionItem(int(Frame.MISSION), int(command), 0, 1, p1, p2, p3, p4, 0, 0, 0.0)._replace(**fields)
    x, y = round(at[0] * 1e4), round(at[1] * 1e4)
    return MissionItem(int(Frame.LOCAL_NED), int(command), 0, 1, p1, p2, p3, p4, x, y, at[2])._replace(**fields)


class FailingStore(MemoryStore):
    """A store on a full or read-only disk, switched on and off."""

    def __init__(self) -> None:
        super().__init__()
        self.writable = self.readable = True

    def read(self, name: str) -> bytes | None:
        if not self.readable:
            raise PermissionError(13, "Permission denied")
        return super().read(name)

    def write(self, name: str, data: bytes) -> None:
        if not self.writable:
            raise OSError(28, "No space left on device")
        super().write(name, data)

    def set_aside(self, name: str) -> None:
        if not self.writable:
            raise OSError(30, "Read-only file system")
        super().set_aside(name)
