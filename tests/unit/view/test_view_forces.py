"""Arrows of force add up to what the telemetry says, forces and moments."""

import numpy as np
import pytest

from gcs_tools.view import airframe_mesh as shape
from gcs_tools.view.forces import arrows
from gcs_tools.view.topics import Load
from sitl.model.airframe import description
from sitl.vehicle_spec import load_vehicle

D = shape.dimensions(description(load_vehicle("yawsitter").airframe))
NONE = Load((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_two_unequal_thrusts_are_drawn_at_their_propellers() -> None:
    left_N, right_N = 7.0, 4.0
    load = Load((left_N + right_N, 0.0, 0.0), (0.01, 0.0, D.prop_arm_m * (left_N - right_N)))
    drawn = arrows({"thrust": load}, NONE, D)
    assert [a.at_B_m[1] for a in drawn] == [-D.prop_arm_m, D.prop_arm_m]
    assert [a.force_B_N[0] for a in drawn] == pytest.approx([left_N, right_N])


def test_every_cause_s_arrows_sum_to_its_force_and_the_split_ones_to_the_moment_that_splits_them() -> None:
    causes = {
        "thrust": Load((11.0, 0.0, 0.0), (0.02, 0.0, 0.3)),
        "flaps": Load((0.0, 0.0, 0.8), (-0.05, 0.07, 0.0)),
        "gravity": Load((-10.0, 0.0, -2.0), (0.0, 0.0, 0.0)),
        "a cause of a later version": Load((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)),
    }
    drawn = arrows(causes, NONE, D)
    for cause, load in causes.items():
        mine = [a for a in drawn if a.cause == cause]
        assert np.sum([a.force_B_N for a in mine], axis=0) == pytest.approx(load.force_B_N)
        moment = np.sum([np.cross(a.at_B_m, a.force_B_N) for a in mine], axis=0)
        if cause == "thrust":
            assert moment[2] == pytest.approx(load.moment_B_N_m[2])
        if cause == "flaps":
            assert moment[0] == pytest.approx(load.moment_B_N_m[0])


def test_what_hardly_acts_is_not_drawn() -> None:
    assert arrows({"drag": NONE, "ground": NONE}, NONE, D) == []
