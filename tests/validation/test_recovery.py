"""Recovery from any attitude: lagging motors and flaps, tuned gains, 20 m above the ground, the state known."""

import pytest

from sitl.quaternion import Vec3
from sitl.reproduce.cases import Craft
from sitl.reproduce.robustness import ANGLES_DEG, BODY_AXES, DRIFTS, excursion

pytestmark = pytest.mark.compiled
EXACT = Craft("yawsitter-real", (("EST_ENABLE", 0.0),))


@pytest.mark.parametrize("axis", BODY_AXES)
def test_it_recovers_from_any_attitude_at_rest_within_four_metres(axis: Vec3) -> None:
    results = {angle: excursion(EXACT, axis, angle, (0.0, 0.0, 0.0)) for angle in ANGLES_DEG}
    assert max(worst for worst, _ in results.values()) < 4.0, results
    assert max(last for _, last in results.values()) < 0.3, results


@pytest.mark.parametrize("axis", BODY_AXES)
@pytest.mark.parametrize("velocity", DRIFTS)
def test_it_recovers_from_any_attitude_drifting_at_five_metres_a_second_within_eight(
    axis: Vec3, velocity: Vec3
) -> None:
    results = {angle: excursion(EXACT, axis, angle, velocity) for angle in ANGLES_DEG}
    assert max(worst for worst, _ in results.values()) < 8.0, results
    assert max(last for _, last in results.values()) < 0.5, results
