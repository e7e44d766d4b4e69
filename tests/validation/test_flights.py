"""Closed-loop flights without a link: steps, disturbances, recoveries, determinism."""

import hashlib
import math
import subprocess
import sys

import numpy as np
import pytest

from sitl.closed_loop import TRACE_COLUMNS
from sitl.frames import heading
from sitl.geodesy import GeoPoint
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.snapshot import Snapshot
from sitl.vehicle import Vehicle, load_vehicle

pytestmark = pytest.mark.compiled
ALL = ("yawsitter", "yawsitter-real", "yawsitter-literal")
NAN = math.nan


def hovering(name: str = "yawsitter", height_m: float = 5.0, **options) -> Vehicle:
    vehicle = Vehicle(load_vehicle(name), **options)
    vehicle.advance(100_000)
    assert vehicle.commander.takeoff(vehicle.commander.origin.alt_amsl_m + height_m).ok
    assert vehicle.commander.arm().ok
    vehicle.advance(15_000_000)
    assert vehicle.commander.mode is Mode.HOLD
    return vehicle


def position(s: Snapshot) -> np.ndarray:
    return np.array((s.truth.north_m, s.truth.east_m, s.truth.down_m))


def traced(vehicle: Vehicle, seconds: float) -> np.ndarray:
    """A row for every control step; columns TRACE_COLUMNS."""
    steps = round(seconds * 1e6) // vehicle.step_us
    trace = np.zeros((steps, len(TRACE_COLUMNS)))
    vehicle.advance(vehicle.now_us + steps * vehicle.step_us, trace)
    return trace


@pytest.mark.parametrize("name", ALL)
def test_it_hovers_within_centimetres(name: str) -> None:
    vehicle = hovering(name)
    trace = traced(vehicle, 10.0)
    assert np.abs(trace[:, 1:4] - (0.0, 0.0, -5.0)).max() < 0.05


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_step_without_feedforward_settles(name: str, axis: int) -> None:
    vehicle = hovering(name)
    target = [0.0, 0.0, -5.0]
    target[axis] += 1.0
    for _ in range(600):
        vehicle.offboard.submit(OffboardTarget(None, position_N=tuple(target)), vehicle.now_us)
        vehicle.advance(vehicle.now_us + 20_000)
        if vehicle.commander.mode is not Mode.OFFBOARD and not vehicle.offboard.lost(vehicle.now_us):
            assert vehicle.commander.set_mode(Mode.OFFBOARD).ok
    assert vehicle.commander.mode is Mode.OFFBOARD
    assert position(vehicle.snapshot()) == pytest.approx(target, abs=0.12)


def test_a_new_gain_acts_at_the_very_next_control_step() -> None:
    one, two = hovering(), hovering()
    for vehicle in (one, two):
        vehicle.commander.guided.reposition((3.0, 0.0, -5.0))
        vehicle.advance(vehicle.now_us + 1_000_000)
    assert one.snapshot().truth == two.snapshot().truth
    two.parameters.set("RATE_Y_P", 1.0)
    before, after = traced(one, 0.002), traced(two, 0.002)
    flaps = TRACE_COLUMNS.index("command_flap_left_rad")
    assert before[0, flaps] != after[0, flaps]


@pytest.mark.parametrize("error", [0, 1])
def test_both_attitude_errors_fly_at_heading_zero(error: int) -> None:
    vehicle = hovering(overrides={"SYS_ATT_ERROR": error})
    vehicle.commander.guided.reposition((4.0, -3.0, -6.0))
    vehicle.advance(vehicle.now_us + 12_000_000)
    assert position(vehicle.snapshot()) == pytest.approx((4.0, -3.0, -6.0), abs=0.05)


@pytest.mark.parametrize("name", ["yawsitter", "yawsitter-real"])
def test_a_full_turn_in_hover_stays_in_place(name: str) -> None:
    vehicle = hovering(name)
    worst = 0.0
    for degrees in (90.0, 180.0, 270.0, 360.0):
        vehicle.commander.guided.reposition((NAN, NAN, NAN), math.radians(degrees))
        trace = traced(vehicle, 6.0)
        worst = max(worst, np.abs(trace[:, 1:4] - (0.0, 0.0, -5.0)).max())
        s = vehicle.snapshot().nav
        turned = heading(s.qw, s.qx, s.qy, s.qz)
        assert math.cos(turned - math.radians(degrees)) > math.cos(math.radians(1.0))
    assert worst < 0.05


def test_it_starts_at_any_heading_and_flies_in_world_axes() -> None:
    vehicle = hovering(heading_rad=math.radians(120.0))
    vehicle.commander.guided.reposition((3.0, 2.0, -4.0))
    vehicle.advance(vehicle.now_us + 10_000_000)
    s = vehicle.snapshot()
    assert position(s) == pytest.approx((3.0, 2.0, -4.0), abs=0.05)
    assert math.degrees(heading(s.nav.qw, s.nav.qx, s.nav.qy, s.nav.qz)) == pytest.approx(120.0, abs=1.0)


def test_it_hovers_in_wind_with_a_bounded_error() -> None:
    vehicle = hovering(wind_N=(2.0, 0.0, 0.0), gust_m_s=0.3)
    trace = traced(vehicle, 20.0)
    assert np.abs(trace[:, 1:4] - (0.0, 0.0, -5.0)).max() < 1.5


def test_a_slower_control_rate_still_flies(tmp_path) -> None:
    text = (
        "description: slow\nairframe: yawsitter\ngains: tuned\ncontrol_rate_hz: 100\n"
        "actuators: {motor_tau_s: 0.04, flap_tau_s: 0.03}\n"
        "sensors: perfect\n"
    )
    (tmp_path / "slow.yaml").write_text(text)
    vehicle = hovering(str(tmp_path / "slow.yaml"))
    assert vehicle.step_us == 10_000
    assert position(vehicle.snapshot()) == pytest.approx((0.0, 0.0, -5.0), abs=0.05)


@pytest.mark.parametrize("gust_m_s", [0.0, 0.5])
def test_the_same_flight_in_other_portions_is_the_same_to_the_bit(gust_m_s: float) -> None:
    one, two = (Vehicle(load_vehicle("yawsitter-real"), seed=5, gust_m_s=gust_m_s) for _ in range(2))
    for vehicle in (one, two):
        vehicle.commander.takeoff()
        vehicle.commander.arm()
    one.advance(6_000_000)
    for t in range(2_000, 6_000_001, 2_000):
        two.advance(t)
    assert one.snapshot() == two.snapshot()


_FLIGHT = """
import hashlib, sys
import numpy as np
from sitl.closed_loop import TRACE_COLUMNS
from sitl.vehicle import Vehicle, load_vehicle
v = Vehicle(load_vehicle("yawsitter-real"), seed=int(sys.argv[1]), gust_m_s=0.5)
v.commander.takeoff(); v.commander.arm()
trace = np.zeros((5000, len(TRACE_COLUMNS)))
v.advance(10_000_000, trace)
print(hashlib.sha256(trace.tobytes()).hexdigest())
"""


def flight_in_a_process_of_its_own(seed: int) -> str:
    result = subprocess.run([sys.executable, "-c", _FLIGHT, str(seed)], capture_output=True, text=True, timeout=100)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_two_processes_with_the_same_seed_log_the_same_bits() -> None:
    first, second, other = (flight_in_a_process_of_its_own(seed) for seed in (7, 7, 8))
    assert len(first.strip()) == hashlib.sha256().digest_size * 2
    assert first == second
    assert first != other


def test_home_decides_where_on_earth_it_stands() -> None:
    vehicle = Vehicle(load_vehicle("yawsitter"), home=GeoPoint(47.0, 8.0, 400.0))
    assert vehicle.snapshot().home == GeoPoint(47.0, 8.0, 400.0)


def test_forces_by_cause_add_up_to_the_weight_in_hover() -> None:
    vehicle = hovering()
    x = vehicle.loads()
    assert set(x) == {"gravity", "thrust", "side_force", "aero", "flaps", "drag", "ground"}
    total = np.sum([load.force_B for load in x.values()], axis=0)
    assert total == pytest.approx(np.zeros(3), abs=0.05)
    assert np.linalg.norm(x["gravity"].force_B) == pytest.approx(1.076 * 9.80665, rel=1e-6)
    moments = np.sum([load.moment_B for load in x.values()], axis=0)
    assert moments == pytest.approx(np.zeros(3), abs=0.01)


def test_hover_empties_the_battery_slowly() -> None:
    vehicle = hovering()
    before = vehicle.snapshot().battery
    vehicle.advance(vehicle.now_us + 60_000_000)
    after = vehicle.snapshot().battery
    assert after.remaining < before.remaining < 1.0
    assert after.voltage_V < before.voltage_V
    assert 50.0 < after.current_A * after.voltage_V < 500.0


def test_a_parameter_that_is_refused_at_start_says_its_range() -> None:
    from sitl.strict_yaml import ConfigError

    with pytest.raises(ConfigError, match=r"parameter POS_X_P: 1000 refused \(out of range\): allowed 0 … 100"):
        Vehicle(load_vehicle("yawsitter"), overrides={"POS_X_P": 1000.0})
    with pytest.raises(ConfigError, match="parameter NO_SUCH: unknown"):
        Vehicle(load_vehicle("yawsitter"), overrides={"NO_SUCH": 1.0})


def test_the_filter_tells_how_well_it_knows_the_position_and_is_about_right() -> None:
    vehicle = hovering("yawsitter-real")
    errors = []
    for _ in range(400):
        vehicle.advance(vehicle.now_us + 100_000)
        s = vehicle.snapshot()
        errors.append((s.nav.north_m - s.truth.north_m, s.nav.east_m - s.truth.east_m, s.nav.down_m - s.truth.down_m))
    level, height = s.nav_accuracy_m
    north, east, down = np.sqrt(np.mean(np.square(errors), axis=0))
    assert level == pytest.approx(math.hypot(north, east), rel=0.5)
    assert height == pytest.approx(down, rel=0.5)
    assert hovering("yawsitter").snapshot().nav_accuracy_m == (0.0, 0.0)


def test_the_filter_can_be_switched_on_in_flight() -> None:
    vehicle = hovering("yawsitter-real", overrides={"EST_ENABLE": 0})
    assert vehicle.parameters.set("EST_ENABLE", 1.0) is None
    trace = traced(vehicle, 10.0)
    assert np.abs(trace[:, 1:4] - (0.0, 0.0, -5.0)).max() < 0.05


def test_it_takes_off_and_lands_in_wind_that_would_slide_it_on_its_feet() -> None:
    vehicle = Vehicle(load_vehicle("yawsitter-real"), wind_N=(-3.0, 0.0, 0.0), seed=2)
    vehicle.advance(1_000_000)
    assert vehicle.commander.takeoff().ok
    assert vehicle.commander.arm().ok
    trace = traced(vehicle, 15.0)
    assert np.abs(trace[:, 1:3]).max() < 1.0
    assert vehicle.commander.land().ok
    vehicle.advance(vehicle.now_us + 20_000_000)
    s = vehicle.snapshot()
    assert (s.armed, s.tipped_over) == (False, False)
