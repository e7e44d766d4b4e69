"""Which loops there are, and how targets excite them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_tools.tune import loops, targets
from gcs_tools.tune.loops import GAIN_NAMES, LOOPS, Excitation, doublet, parse, step, turn_between, turned
from sitl.control import gains


def test_the_loops_gains_are_the_vehicles() -> None:
    assert GAIN_NAMES == gains.GAIN_NAMES
    assert len(LOOPS) == 12


@pytest.mark.parametrize(
    ("text", "name"), [("attitude.θ", "attitude.theta"), ("Attitude.Y", "attitude.theta"), ("rate.z", "rate.r")]
)
def test_axes_go_by_other_names_too(text: str, name: str) -> None:
    assert parse(text).name == name


def test_a_loop_that_there_is_not_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(
        ValueError, match=r"'position\.w' is not a loop \(do you mean position\..\?\): position\.x\|y\|z, "
    ):
        parse("position.w")


@given(st.integers(0, 2), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_turn_about_a_body_axis_is_read_back_as_that(axis: int, angle: float, a: float, b: float) -> None:
    base = loops.multiply(loops.about_z(a), loops.about_y(b))
    wanted = [0.0, 0.0, 0.0]
    wanted[axis] = angle
    assert turn_between(base, turned(base, axis, angle)) == pytest.approx(tuple(wanted), abs=1e-9)
    opposite = tuple(-x for x in turned(base, axis, angle))
    assert turn_between(base, opposite) == pytest.approx(tuple(wanted), abs=1e-9)  # type: ignore[arg-type]


def test_levels_are_held_one_after_the_other() -> None:
    assert [step(2.0, 3.0).at(t) for t in (-0.1, 0.0, 2.99, 3.0, 99.0)] == [0.0, 2.0, 2.0, 0.0, 0.0]
    assert [doublet(2.0, 3.0).at(t) for t in (-0.1, 0.0, 3.0, 6.0, 99.0)] == [0.0, 2.0, -2.0, 0.0, 0.0]


def test_a_velocity_lets_go_of_its_own_position_only() -> None:
    from gcs_tools.client import Client

    target = targets.excited(Client(), 5, parse("velocity.y"), (1.0, 2.0, -3.0), 0.7)
    assert (target.x, target.vy, target.z) == (1.0, 0.7, -3.0)
    ignored = [k for k in range(12) if target.type_mask >> k & 1]
    assert ignored == [1, 3, 5, 6, 7, 8, 10, 11]


def test_height_is_kept_by_thrust_while_leaning() -> None:
    hover = loops.about_y(math.pi / 2)
    keep = targets.height_keeping
    assert keep(0.5, hover, hover, 0.0, 0.0) == pytest.approx(0.5)
    assert keep(0.5, turned(hover, 2, math.radians(60.0)), hover, 0.0, 0.0) == pytest.approx(1.0)
    assert keep(0.5, hover, hover, 1.0, 0.5) > 0.5 > keep(0.5, hover, hover, -1.0, -0.5)


def test_an_excitation_ends_at_rest() -> None:
    for excitation in (step(1.0, 2.0), doublet(1.0, 2.0)):
        assert isinstance(excitation, Excitation)
        assert excitation.levels[-1] == 0.0
