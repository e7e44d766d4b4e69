import numpy as np

from sitl.calm_array import calm_array
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, run
from sitl.control.guidance import Actuation, Guidance, Steering
from sitl.control.reference import Trajectory
from sitl.loop_arrays import (
    LOOP_SIZE,
    OBSERVED_SIZE,
    guidance_array,
    guidance_of,
    loop_of,
    nav_of,
    observed_of,
    put_loop,
    run_in_place,
    state_of,
)
from sitl.tally import NOTHING, tally
from sitl.vehicle import Vehicle, load_vehicle


def test_every_number_of_the_loops_state_survives_the_array() -> None:
    numbers = np.arange(1.0, LOOP_SIZE + 1.0)
    again = np.zeros(LOOP_SIZE)
    put_loop(again, loop_of(numbers))
    assert (again == numbers).all()
    assert tuple(state_of(numbers)) == tuple(numbers[:17])


def test_every_number_of_a_guidance_survives_the_array() -> None:
    trajectory = Trajectory(np.array([1.0, 2.0]), np.arange(3.0, 51.0).reshape(2, 4, 6), 51.0)
    guidance = Guidance(3, trajectory, *map(float, range(4, 11)), Steering(*range(11, 20)), Actuation(*range(20, 24)))
    again = guidance_of(guidance_array(guidance))
    assert (again.trajectory.start_s == trajectory.start_s).all()
    assert (again.trajectory.coefficients == trajectory.coefficients).all()
    assert again.trajectory.end_s == trajectory.end_s
    assert again._replace(trajectory=trajectory) == guidance


def test_running_in_place_is_running() -> None:
    vehicle = Vehicle(load_vehicle("yawsitter-real"))
    vehicle.commander.takeoff()
    vehicle.commander.arm()
    vehicle.advance(2_000_000)
    noise = np.random.default_rng(1).standard_normal((10, NOISE_COLUMNS))
    traces = [np.zeros((10, len(TRACE_COLUMNS))) for _ in range(2)]
    again, array, seen = np.zeros(LOOP_SIZE), np.zeros(LOOP_SIZE), np.zeros(OBSERVED_SIZE)
    put_loop(array, vehicle.loop)
    around = calm_array(0.0), tally(), NOTHING
    constants, guidance = (vehicle._plants, vehicle._controllers), vehicle._guidance
    loop, observed = run(*constants, guidance, vehicle.loop, noise, 2_000_000, 2000, 10, traces[0])
    run_in_place(*constants, guidance_array(guidance), array, noise, 2_000_000, 2000, 10, traces[1], seen, *around)
    put_loop(again, loop)
    assert (again == array).all()
    assert observed_of(seen) == observed
    assert nav_of(seen) == observed.nav
    assert (traces[0] == traces[1]).all()
    assert traces[0].any()


def test_all_vehicles_constants_are_of_the_one_type_that_numba_knows_already() -> None:
    first, second = Vehicle(load_vehicle("yawsitter")), Vehicle(load_vehicle("yawsitter-real"))
    assert first._plants.dtype is second._plants.dtype
    assert first._controllers.dtype is second._controllers.dtype
