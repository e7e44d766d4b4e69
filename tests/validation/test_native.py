"""The plant and the cascade once more, written by hand in C, on random states and over a flight."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import native
from sitl.model.derivative import ActuatorCommand

SUBJECT = native.subject("yawsitter-real")


@pytest.fixture(scope="module")
def c(tmp_path_factory: pytest.TempPathFactory) -> object:
    library = native.built(Path(tmp_path_factory.mktemp("c")))
    if library is None:
        pytest.skip("there is no C compiler (cc) here")
    return library


@pytest.mark.parametrize("wind_N", [(0.0, 0.0, 0.0), (3.0, -2.0, 0.5)])
def test_all_loads_are_those_of_the_same_laws_written_in_c(c, wind_N) -> None:
    states, command = native.random_states(500), ActuatorCommand(5.0, 6.0, 0.1, -0.2)
    rates = native.derivatives(SUBJECT, states, command, wind_N)
    assert native.difference(native.c_derivatives(c, SUBJECT, states, command, wind_N), rates) < native.AGREE
    on_the_ground = np.abs(rates[:, 3:6]).max(axis=1) > 1000.0
    assert 20 < on_the_ground.sum() < 480  # both kinds are among them


@pytest.mark.compiled
@pytest.mark.parametrize("tumbling", [False, True])
def test_ten_seconds_of_a_flight_are_those_of_the_same_cascade_written_in_c(c, tumbling) -> None:
    """From standing, and from a tumble with every actuator at its limit."""
    subject = SUBJECT
    if tumbling:
        state = SUBJECT.loop.state._replace(qw=0.5, qx=-0.5, qy=0.5, qz=0.5, down_m=-30.0, v_east_m_s=5.0, p_rad_s=3.0)
        subject = SUBJECT._replace(loop=SUBJECT.loop._replace(state=state))
    state, memory = native.closed_loop(subject, 5_000)
    state_c, memory_c = native.c_closed_loop(c, subject, 5_000)
    assert native.difference(state_c, native.flat(state)) < native.AGREE
    assert native.difference(memory_c, native.flat(memory)) < native.AGREE
