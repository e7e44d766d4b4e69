"""Targets and sticks from the wire to the vehicle."""

import math
from typing import Any

import pytest
from mavlink_pair import Station, World

from sitl.geodesy import to_global
from sitl.mavlink.codec import mav
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget

NAN = math.nan
NAN3 = (NAN, NAN, NAN)
POSITION, VELOCITY, ACCELERATION, YAW, YAW_RATE = 0x007, 0x038, 0x1C0, 0x400, 0x800
EVERYTHING = POSITION | VELOCITY | ACCELERATION | YAW | YAW_RATE
FIELDS = {"x": 1.0, "y": 2.0, "z": -3.0, "vx": 0.5, "vy": 0.25, "vz": -0.125, "afx": 0.1, "afy": 0.2, "afz": 0.3}
FIELDS |= {"yaw": 0.75, "yaw_rate": 0.05}


def close(a: Any, b: Any, tolerance: float = 1e-6) -> bool:
    return a == pytest.approx(b, abs=tolerance, nan_ok=True)


def target(world: World, name: str = "SET_POSITION_TARGET_LOCAL_NED", **fields: Any) -> OffboardTarget | None:
    """What the vehicle makes of one message."""
    station = world.stations[0] if world.stations else world.station()
    world.vehicle.offboard.target = None
    station.send(name, **{"target_system": 1, "target_component": 1, "coordinate_frame": 1, **fields})
    world.step()
    result: OffboardTarget | None = world.vehicle.offboard.target
    return result


def turn(world: World, heading_rad: float) -> tuple[float, float, float]:
    """Put the vehicle at a heading and a place; returns the place."""
    from sitl.frames import standing

    real = world.vehicle.snapshot
    q = standing(heading_rad, math.pi / 2)

    def turned() -> Any:
        s = real()
        moved = s.nav._replace(north_m=10.0, east_m=20.0, down_m=-30.0, qw=q[0], qx=q[1], qy=q[2], qz=q[3])
        return s._replace(nav=moved)

    world.vehicle.snapshot = turned
    return 10.0, 20.0, -30.0


def test_a_full_target_carries_position_velocity_acceleration_yaw_and_yaw_rate(world: World) -> None:
    t = target(world, **FIELDS)
    assert close(t.position_N, (1.0, 2.0, -3.0))
    assert close(t.velocity_N, (0.5, 0.25, -0.125))
    assert close(t.acceleration_N, (0.1, 0.2, 0.3))
    assert close((t.heading_rad, t.heading_rate_rad_s), (0.75, 0.05))
    assert t.stamp_us is None


MASKS = {
    "position": (EVERYTHING ^ POSITION, "position_N"),
    "velocity": (EVERYTHING ^ VELOCITY, "velocity_N"),
    "acceleration": (EVERYTHING ^ ACCELERATION, "acceleration_N"),
}


@pytest.mark.parametrize("what", MASKS)
def test_the_mask_leaves_only_what_binds(world: World, what: str) -> None:
    mask, kept = MASKS[what]
    t = target(world, **FIELDS, type_mask=mask)
    for field in ("position_N", "velocity_N", "acceleration_N"):
        assert any(map(math.isnan, getattr(t, field))) == (field != kept)
    assert math.isnan(t.heading_rad)
    assert math.isnan(t.heading_rate_rad_s)


@pytest.mark.parametrize("axis", range(9))
def test_each_axis_is_ignored_by_its_own_bit_or_by_not_a_number(world: World, axis: int) -> None:
    masked = target(world, **FIELDS, type_mask=1 << axis)
    unset = target(world, **{**FIELDS, list(FIELDS)[axis]: NAN})
    for t in (masked, unset):
        values = (*t.position_N, *t.velocity_N, *t.acceleration_N)
        assert [math.isnan(v) for v in values] == [k == axis for k in range(9)]


def test_yaw_bits_are_yaws_alone(world: World) -> None:
    assert math.isnan(target(world, **FIELDS, type_mask=YAW).heading_rad)
    assert close(target(world, **FIELDS, type_mask=YAW).heading_rate_rad_s, 0.05)
    assert math.isnan(target(world, **FIELDS, type_mask=YAW_RATE).heading_rate_rad_s)


def test_body_frames_turn_with_the_heading_and_offsets_start_at_the_vehicle(world: World) -> None:
    world.station()
    n, e, d = turn(world, math.pi / 2)  # belly to the east: forward is east, right is south
    expected = {
        1: ((1.0, 2.0, -3.0), (0.5, 0.25, -0.125), (0.1, 0.2, 0.3)),
        7: ((n + 1.0, e + 2.0, d - 3.0), (0.5, 0.25, -0.125), (0.1, 0.2, 0.3)),
        8: ((1.0, 2.0, -3.0), (-0.25, 0.5, -0.125), (-0.2, 0.1, 0.3)),
        9: ((n - 2.0, e + 1.0, d - 3.0), (-0.25, 0.5, -0.125), (-0.2, 0.1, 0.3)),
        12: ((n - 2.0, e + 1.0, d - 3.0), (-0.25, 0.5, -0.125), (-0.2, 0.1, 0.3)),
    }
    for frame, (position, velocity, acceleration) in expected.items():
        t = target(world, **FIELDS, coordinate_frame=frame)
        assert close(t.position_N, position, 1e-5), frame
        assert close(t.velocity_N, velocity), frame
        assert close(t.acceleration_N, acceleration), frame
        assert close(t.heading_rad, 0.75), frame


@pytest.mark.parametrize("frame", [0, 2, 3, 4, 5, 6, 10, 11, 13, 20, 21, 255])
def test_other_frames_are_refused_with_one_text(world: World, frame: int) -> None:
    station = world.station()
    for _ in range(20):
        assert target(world, **FIELDS, coordinate_frame=frame) is None
    assert len([text for text in station.texts() if f"frame {frame}" in text]) == 1


GLOBAL_FRAMES = [(5, 0.0), (0, 0.0), (6, 1.0), (3, 1.0), (11, 1.0), (10, 1.0)]


@pytest.mark.parametrize(("frame", "relative"), GLOBAL_FRAMES)
def test_global_targets_land_in_the_local_frame(world: World, frame: int, relative: float) -> None:
    world.station()
    origin, home = world.vehicle.commander.origin, world.vehicle.commander.home
    lat, lon = to_global(origin, 40.0, -30.0)
    alt = origin.alt_amsl_m + 6.0 - relative * home.alt_amsl_m
    place = {"lat_int": round(lat * 1e7), "lon_int": round(lon * 1e7), "alt": alt}
    rest = {name: FIELDS[name] for name in ("vx", "vy", "vz", "afx", "afy", "afz", "yaw")}
    t = target(world, "SET_POSITION_TARGET_GLOBAL_INT", **place, **rest, coordinate_frame=frame)
    assert close(t.position_N, (40.0, -30.0, -6.0), 0.01)
    assert close(t.velocity_N, (0.5, 0.25, -0.125))
    assert close(t.heading_rad, 0.75)


@pytest.mark.parametrize(
    ("fields", "unset"),
    [
        ({"type_mask": 1}, (True, True, False)),
        ({"type_mask": 4}, (False, False, True)),
        ({"lat_int": 2**31 - 1}, (True, True, False)),
    ],
)
def test_latitude_and_longitude_are_ignored_together(
    world: World, fields: dict[str, int], unset: tuple[bool, ...]
) -> None:
    t = target(
        world,
        "SET_POSITION_TARGET_GLOBAL_INT",
        **{"lat_int": 556985000, "lon_int": 373595000, "alt": 200.0, "coordinate_frame": 5, **fields},
    )
    assert tuple(map(math.isnan, t.position_N)) == unset


def test_global_targets_off_the_earth_are_refused(world: World) -> None:
    fields = {"lat_int": 1_000_000_000, "lon_int": 0, "coordinate_frame": 5}
    assert target(world, "SET_POSITION_TARGET_GLOBAL_INT", **fields) is None


def test_forces_are_refused(world: World) -> None:
    assert target(world, **FIELDS, type_mask=0x200) is None
    assert any("forces" in text for text in world.stations[0].texts())


def test_a_force_that_is_ignored_is_none(world: World) -> None:
    velocity_only = target(world, **FIELDS, type_mask=0xFC7)  # as MAVProxy's `velocity` sends it
    assert not any(math.isnan(v) for v in velocity_only.velocity_N)
    assert all(math.isnan(a) for a in velocity_only.acceleration_N)


def test_a_target_that_ignores_everything_is_refused_and_explained(world: World) -> None:
    assert target(world, **FIELDS, type_mask=EVERYTHING) is None
    assert any("ignores everything" in text for text in world.stations[0].texts())


@pytest.mark.parametrize("value", [math.inf, -math.inf, 3e38])
@pytest.mark.parametrize("field", FIELDS)
def test_targets_that_are_no_numbers_leave_the_old_one_in_force(world: World, field: str, value: float) -> None:
    world.station()
    good = target(world, **FIELDS)
    world.stations[0].send("SET_POSITION_TARGET_LOCAL_NED", coordinate_frame=1, **{**FIELDS, field: value})
    world.vehicle.offboard.target = good
    world.step()
    if math.isinf(value):
        assert world.vehicle.offboard.target == good
    assert world.endpoint.faults == 0


def test_stamps_are_on_the_vehicles_clock_and_unwrapped(world: World) -> None:
    world.station()
    world.run(0.5)
    now_ms = world.vehicle.now_us // 1000
    assert target(world, **FIELDS, time_boot_ms=now_ms - 40).stamp_us == (now_ms - 40) * 1000
    assert target(world, **FIELDS, time_boot_ms=0).stamp_us is None


def test_offboard_flies_a_streamed_position_and_echoes_it(world: World) -> None:
    station = world.station()
    position_only = EVERYTHING ^ POSITION

    def stream(seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            station.send(
                "SET_POSITION_TARGET_LOCAL_NED",
                target_system=1,
                target_component=1,
                coordinate_frame=1,
                type_mask=position_only,
                x=0.0,
                y=0.0,
                z=-2.0,
                time_boot_ms=world.vehicle.now_us // 1000,
            )
            world.run(0.05)

    stream(1.2)
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 6) == [0]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [0]
    stream(6.0)
    assert world.vehicle.commander.mode is Mode.OFFBOARD
    assert station.all("POSITION_TARGET_LOCAL_NED")[-1].z == pytest.approx(-2.0, abs=0.01)
    assert station.all("LOCAL_POSITION_NED")[-1].z == pytest.approx(-2.0, abs=0.2)


def test_sticks_go_to_the_commander_in_its_own_scale(world: World) -> None:
    station = world.station()
    sticks: list[tuple[float, ...]] = []
    world.vehicle.commander.manual = lambda *axes: sticks.append(axes)
    for x, y, z, r in (
        (1000, -1000, 500, 0),
        (500, 250, 1000, -250),
        (0, 0, 0, 0),
        (32767, 32767, 32767, 32767),
        (2000, -2000, 3000, 0),
    ):
        station.send("MANUAL_CONTROL", target=1, x=x, y=y, z=z, r=r)
    station.send("MANUAL_CONTROL", target=2, x=1000)
    world.run(0.02)
    assert sticks == [
        (1.0, -1.0, 0.0, 0.0),
        (0.5, 0.25, 1.0, -0.25),
        (0.0, 0.0, -1.0, 0.0),
        (0.0, 0.0, 0.0, 0.0),
        (1.0, -1.0, 1.0, 0.0),
    ]


# attitude targets

IGNORE_RATES, IGNORE_ATTITUDE, IGNORE_THROTTLE = 7, 0x80, 0x40


def attitude_target(station: Station, **fields: object) -> None:
    station.send("SET_ATTITUDE_TARGET", target_system=1, target_component=1, **fields)


@pytest.mark.compiled
def test_an_attitude_is_flown_as_it_was_sent_and_echoed(world: World) -> None:
    """As MAVSDK sends it: one target, then the mode at once, then 20 a second."""
    station = world.station()
    world.take_off(station, 10.0)
    half = 0.5 * math.radians(10.0)
    a = world.vehicle.spec.airframe.airframe
    thrust = a.mass_kg * 9.80665 / (2.0 * a.thrust_max_N)
    q = (math.cos(half), 0.0, math.sin(half), 0.0)
    attitude_target(station, q=q, thrust=thrust, type_mask=IGNORE_RATES)
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 6) == [0]
    for _ in range(20):
        attitude_target(station, q=q, thrust=thrust, type_mask=IGNORE_RATES)
        world.run(0.05)
    assert world.vehicle.commander.mode is Mode.OFFBOARD
    seen, echo = station.all("ATTITUDE")[-1], station.all("ATTITUDE_TARGET")[-1]
    assert (seen.roll, seen.pitch, seen.yaw) == pytest.approx((0.0, math.radians(10.0), 0.0), abs=math.radians(2.0))
    assert echo.q == pytest.approx(q, abs=1e-6)
    assert echo.thrust == pytest.approx(thrust, rel=0.1)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"q": (1.0, 0.0, 0.0, 0.0), "type_mask": IGNORE_RATES | IGNORE_THROTTLE, "thrust": 0.5}, "thrust"),
        ({"q": (1.0, 0.0, 0.0, 0.0), "type_mask": IGNORE_RATES, "thrust": 1.5}, "0 ? 1"),
        ({"q": (1.0, 0.0, 0.0, 0.0), "type_mask": IGNORE_RATES | 0x20, "thrust": 0.5}, "along the nose"),
        ({"q": (0.0, 0.0, 0.0, 0.0), "type_mask": IGNORE_RATES, "thrust": 0.5}, "no direction"),
        ({"type_mask": IGNORE_ATTITUDE | 1, "thrust": 0.5}, "three body rates"),
        ({"q": (NAN, NAN, NAN, NAN), "type_mask": IGNORE_RATES, "thrust": 0.5}, "three body rates"),
    ],
)
def test_an_attitude_target_that_lacks_something_is_refused_once(world: World, fields: dict, reason: str) -> None:
    station = world.station()
    for _ in range(10):
        attitude_target(station, **fields)
        world.step()
    assert len([text for text in station.texts() if reason in text]) == 1
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 6) == [2]
