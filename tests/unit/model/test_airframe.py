import math

import numpy as np
import pytest

from sitl.model.aerodynamics import separated
from sitl.model.airframe import Airframe, loaded
from sitl.vehicle import load_vehicle

AIRFRAME = load_vehicle("yawsitter").airframe.airframe


def test_an_airframe_loaded_for_a_kernel_has_each_number_in_its_place() -> None:
    numbered = Airframe(*(float(k) for k in range(len(Airframe._fields))))
    assert loaded(numbered) == numbered


@pytest.mark.parametrize("sharpness", [5.0, 40.0, 4000.0])
def test_separation_is_the_printed_blend_of_two_exponentials(sharpness: float) -> None:
    a = AIRFRAME._replace(stall_sharpness=sharpness)
    for alpha in np.linspace(-math.pi, math.pi, 721).tolist():
        above = math.exp(max(-700.0, min(700.0, -sharpness * (alpha - a.stall_angle_rad))))
        below = math.exp(max(-700.0, min(700.0, sharpness * (alpha + a.stall_angle_rad))))
        # as printed, its numerator and denominator divided by the greatest of the terms, which may be e^700
        big = max(1.0, above, below)
        printed = (1.0 / big + above / big + below / big) / ((1.0 + above) / big * (1.0 + below))
        assert separated(a, alpha) == pytest.approx(printed, abs=1e-14)
