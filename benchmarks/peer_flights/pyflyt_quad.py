"""PyFlyt: its Crazyflie held at a place by its own position controller, rigid body by PyBullet at 240 Hz."""

import numpy as np
import timed
from PyFlyt.core import Aviary

POSITION_MODE = 7
PLACE = np.array([1.0, 1.0, 0.0, 1.5])  # x, y, heading, z


def fly(seconds: float) -> float:
    world = Aviary(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), drone_type="quadx", seed=1)
    world.set_mode(POSITION_MODE)
    world.set_setpoint(0, PLACE)
    while world.elapsed_time < seconds:
        world.step()
    away = np.abs(world.state(0)[-1] - PLACE[[0, 1, 3]]).max()
    world.disconnect()
    assert seconds < 10.0 or away < 0.1, away
    return float(world.elapsed_time)


timed.tell(fly, 10.0)
