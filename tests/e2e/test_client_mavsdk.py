"""MAVSDK, both generations, flying the real daemon over UDP: what its users' scripts do."""

import asyncio
import contextlib
import math
from collections.abc import Iterator

import pytest
from mavsdk_drone import STEP_S, Drone, Generation, flown, until
from recorded import recorded

pytestmark = pytest.mark.e2e

SPEED = 5
METRE_DEG = 1.0 / 111_319.5  # of latitude
NAN = math.nan


@pytest.fixture(scope="module", params=list(Generation), ids=lambda generation: generation.value)
def drone(request, tmp_path_factory) -> Iterator[tuple[asyncio.Runner, Drone]]:
    """A connected vehicle, and the loop in which its plugins live; shared by all tests of one generation.

    MAVSDK repeats its offboard targets 20 times a second of wall time; on a busy machine, at several times real time,
    half a second of simulation is soon over.
    """
    generation, folder = request.param, tmp_path_factory.mktemp("mavsdk")
    own = ("--speed", str(SPEED), "--set", "COM_OF_LOSS_T=20", "--record", str(folder / "flights"))
    with recorded(generation.value, folder, *own, onboard=True) as running, asyncio.Runner() as runner:
        connection = Drone.connected(generation, f"udpout://127.0.0.1:{running.port}")
        yield runner, runner.run(connection.__aenter__())
        runner.run(connection.__aexit__(None, None, None))


@flown
async def test_it_is_healthy_and_says_that_it_is_a_simulator(drone: Drone) -> None:
    assert await drone.told("health_all_ok", bool)
    product = await drone.info.get_product()
    assert (product.vendor_id, product.product_id) == (0x5957, 0x5354)
    version = await drone.info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == (0, 1)
    assert await drone.told("home", lambda home: abs(home.latitude_deg) > 1.0)
    vtol = drone.types("telemetry").VtolState
    assert await drone.told("vtol_state") == vtol.MC


@flown
async def test_its_pace_is_known(drone: Drone) -> None:
    for _ in range(60):  # an average of MAVSDK's own that needs some messages
        factor = await drone.info.get_speed_factor()
        if abs(factor - SPEED) < 0.2 * SPEED:
            return
        await asyncio.sleep(0.5)
    raise AssertionError(f"speed factor {factor}")


@flown
async def test_parameters_of_both_types_are_written_and_read_back(drone: Drone) -> None:
    await drone.param.set_param_float("POS_X_P", 1.25)
    assert await drone.param.get_param_float("POS_X_P") == 1.25
    await drone.param.set_param_int("COM_OBL_RC_ACT", 4)
    assert await drone.param.get_param_int("COM_OBL_RC_ACT") == 4
    everything = await drone.param.get_all_params()
    assert {p.name: p.value for p in everything.int_params}["COM_OBL_RC_ACT"] == 4
    floats = {p.name: p.value for p in everything.float_params}
    assert floats["POS_X_P"] == 1.25
    assert len([name for name in floats if name.split("_")[0] in ("POS", "VEL", "ATT", "RATE")]) == 36


@flown
async def test_a_write_that_is_refused_says_why(drone: Drone) -> None:
    error = drone.types("param").ParamError
    with pytest.raises(error, match="VALUE_OUT_OF_RANGE"):
        await drone.param.set_param_float("POS_X_P", 1e9)
    with pytest.raises(error, match="DOES_NOT_EXIST"):
        await drone.param.get_param_float("NO_SUCH_NAME")
    with pytest.raises(error, match="TYPE_MISMATCH"):
        await drone.param.set_param_int("POS_X_P", 3)


@flown
async def test_telemetry_comes_at_the_rate_that_was_set(drone: Drone) -> None:
    await drone.telemetry.set_rate_attitude_quaternion(4.0)
    stamps: list[int] = []

    def enough(attitude) -> bool:
        stamps.append(attitude.timestamp_us)
        return len(stamps) >= 12

    await until(drone.stream("telemetry", "attitude_quaternion"), enough, STEP_S)
    gaps = [later - earlier for earlier, later in zip(stamps[-6:], stamps[-5:], strict=False)]
    assert sum(gaps) / len(gaps) == pytest.approx(250_000, rel=0.1)  # of simulation time
    for setter in (
        *("position", "home", "in_air", "landed_state", "vtol_state", "attitude_euler", "velocity_ned", "raw_gps"),
        *("gps_info", "battery", "actuator_output_status", "position_velocity_ned", "fixedwing_metrics", "imu"),
        *("ground_truth", "unix_epoch_time", "altitude", "health"),
    ):
        await getattr(drone.telemetry, f"set_rate_{setter}")(10.0)
    assert (await drone.told("battery")).remaining_percent == pytest.approx(100.0, abs=5.0)
    assert (await drone.told("raw_gps")).latitude_deg == pytest.approx((await drone.told("home")).latitude_deg)
    await drone.told("ground_truth", lambda truth: truth.latitude_deg > 1.0)


@flown
async def test_home_is_set_above_the_sea(drone: Drone) -> None:
    if drone.generation is Generation.GRPC:
        pytest.skip("MAVSDK 3 can't")
    start = await drone.told("home")
    await drone.action.set_home(False, start.latitude_deg, start.longitude_deg, start.absolute_altitude_m - 1.0)
    await drone.told("home", lambda home: abs(home.absolute_altitude_m - start.absolute_altitude_m + 1.0) < 0.01)
    await drone.action.set_home(True, math.nan, math.nan, math.nan)
    await drone.told("home", lambda home: abs(home.absolute_altitude_m - start.absolute_altitude_m) < 0.01)


@flown
async def test_it_takes_off_to_the_height_that_was_set(drone: Drone) -> None:
    await drone.action.set_takeoff_altitude(4.0)
    assert await drone.action.get_takeoff_altitude() == 4.0
    await drone.action.arm()
    assert await drone.told("armed", bool)
    await drone.action.takeoff()
    landed = drone.types("telemetry").LandedState
    await drone.told("landed_state", lambda state: state == landed.IN_AIR)
    await drone.mode("HOLD")
    assert (await drone.told("position")).relative_altitude_m == pytest.approx(4.0, abs=0.3)
    assert await drone.told("in_air", bool)


@flown
async def test_it_goes_where_it_is_told_faces_there_and_circles(drone: Drone) -> None:
    start = await drone.airborne()
    goal = start.latitude_deg + 5.0 * METRE_DEG
    await drone.action.goto_location(goal, start.longitude_deg, start.absolute_altitude_m + 1.0, 90.0)
    await drone.told("position", lambda p: abs(p.latitude_deg - goal) < 0.2 * METRE_DEG)
    await drone.told("position", lambda p: abs(p.absolute_altitude_m - start.absolute_altitude_m - 1.0) < 0.2)
    await drone.told("heading", lambda heading: abs(heading.heading_deg - 90.0) < 3.0)
    await drone.action.set_current_speed(3.0)
    facing = drone.types("action").OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    await drone.action.do_orbit(4.0, 2.0, facing, start.latitude_deg, start.longitude_deg, start.absolute_altitude_m)
    await drone.told("velocity_ned", lambda v: abs(math.hypot(v.north_m_s, v.east_m_s) - 2.0) < 0.2)
    height = (await drone.told("position")).absolute_altitude_m  # MAVSDK says above home and means above the sea
    assert height == pytest.approx(start.absolute_altitude_m, abs=0.3)
    await drone.action.hold()
    await drone.mode("HOLD")


@flown
async def test_a_mission_is_uploaded_read_back_flown_and_followed(drone: Drone) -> None:
    here = await drone.airborne()
    types = drone.types("mission")
    item, camera, action = types.MissionItem, types.MissionItem.CameraAction, types.MissionItem.VehicleAction

    def waypoint(north_m: float, east_m: float, through: bool = True):
        lat = here.latitude_deg + north_m * METRE_DEG
        lon = here.longitude_deg + east_m * METRE_DEG
        free = (NAN, NAN, camera.NONE, NAN, NAN, 0.5, NAN, NAN, action.NONE)
        return item(lat, lon, 5.0, 3.0, through, *free)

    await drone.mission.set_return_to_launch_after_mission(False)
    plan = types.MissionPlan([waypoint(0, 0), waypoint(5, 0), waypoint(5, 5, through=False)])
    await drone.mission.upload_mission(plan)
    back = (await drone.mission.download_mission()).mission_items
    assert [round(i.latitude_deg, 7) for i in back] == [round(i.latitude_deg, 7) for i in plan.mission_items]
    assert [i.speed_m_s for i in back] == [3.0, 3.0, 3.0]

    await drone.mission.start_mission()
    await drone.mode("MISSION")
    seen: list[int] = []

    def finished(progress) -> bool:
        seen.append(progress.current)
        return progress.current == progress.total == 3

    await until(drone.stream("mission", "mission_progress"), finished, STEP_S)
    assert seen == sorted(seen)
    assert await drone.mission.is_mission_finished()
    await drone.mode("HOLD")
    there = await drone.told("position")
    assert there.latitude_deg == pytest.approx(plan.mission_items[2].latitude_deg, abs=METRE_DEG)
    await drone.mission.set_current_mission_item(0)
    await drone.mission.clear_mission()


@flown
async def test_offboard_flies_to_positions_and_at_velocities(drone: Drone) -> None:
    await drone.airborne()
    types = drone.types("offboard")
    await drone.offboard.set_position_ned(types.PositionNedYaw(2.0, 1.0, -4.0, 0.0))
    await drone.offboard.start()
    assert await drone.offboard.is_active()
    await drone.mode("OFFBOARD")
    await drone.told("position_velocity_ned", lambda m: math.dist(ned(m.position), (2.0, 1.0, -4.0)) < 0.2)

    await drone.offboard.set_velocity_ned(types.VelocityNedYaw(0.0, 1.0, 0.0, 0.0))
    await drone.told("velocity_ned", lambda v: abs(v.east_m_s - 1.0) < 0.1 and abs(v.north_m_s) < 0.1)
    await drone.offboard.set_velocity_body(types.VelocityBodyYawspeed(1.0, 0.0, 0.0, 0.0))
    await drone.told("velocity_ned", lambda v: abs(v.north_m_s - 1.0) < 0.1)  # it faces north
    position, velocity = types.PositionNedYaw(0.0, 0.0, -4.0, 0.0), types.VelocityNedYaw(0.0, 0.0, 0.0, 0.0)
    await drone.offboard.set_position_velocity_ned(position, velocity)
    await drone.told("position_velocity_ned", lambda m: math.dist(ned(m.position), (0.0, 0.0, -4.0)) < 0.2)
    here = await drone.told("position")
    above = types.PositionGlobalYaw.AltitudeType.REL_HOME
    await drone.offboard.set_position_global(
        types.PositionGlobalYaw(here.latitude_deg, here.longitude_deg, 5.0, 0.0, above)
    )
    await drone.told("position", lambda p: abs(p.relative_altitude_m - 5.0) < 0.2)
    await drone.offboard.set_attitude(types.Attitude(0.0, 0.0, 0.0, 0.5))
    await asyncio.sleep(0.5)
    assert await drone.offboard.is_active()
    await drone.offboard.stop()
    await drone.mode("HOLD")


def ned(position) -> tuple[float, float, float]:
    return position.north_m, position.east_m, position.down_m


@flown
async def test_a_geofence_is_taken_and_read_back(drone: Drone) -> None:
    types, here = drone.types("geofence"), await drone.told("position")
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    points = [types.Point(here.latitude_deg + n * 1e-3, here.longitude_deg + e * 1e-3) for n, e in corners]
    centre = types.Point(here.latitude_deg, here.longitude_deg)
    inside = types.FenceType.INCLUSION
    fence = types.GeofenceData([types.Polygon(points, inside)], [types.Circle(centre, 90.0, inside)])
    await drone.geofence.upload_geofence(fence)
    back = await drone.geofence.download_geofence()
    assert [round(p.latitude_deg, 7) for p in back.polygons[0].points] == [round(p.latitude_deg, 7) for p in points]
    assert [c.radius for c in back.circles] == [90.0]
    await drone.geofence.clear_geofence()


@flown
async def test_folders_are_listed(drone: Drone) -> None:
    listing = await drone.ftp.list_directory("/")
    names = listing.dirs if drone.generation is Generation.GRPC else [entry.name for entry in listing.entries]
    assert "metadata" in names


@flown
async def test_it_returns_lands_and_disarms_by_itself(drone: Drone) -> None:
    await drone.airborne()
    await drone.action.return_to_launch()
    await drone.mode("RETURN_TO_LAUNCH")
    await drone.action.land()
    await drone.mode("LAND")
    landed = drone.types("telemetry").LandedState
    await drone.told("landed_state", lambda state: state == landed.ON_GROUND)
    await drone.told("armed", lambda armed: not armed)


@flown
async def test_the_flight_is_among_the_logs(drone: Drone) -> None:
    errors = drone.types("log_files")
    for _ in range(60):  # it is written out after disarming
        with contextlib.suppress(errors.LogFilesError):
            entries = await drone.log_files.get_entries()
            if any(entry.size_bytes > 0 for entry in entries):
                return
        await asyncio.sleep(0.5)
    raise AssertionError("no log of the flight")
