"""Crazyflow: Crazyflies held at a place by its own cascade, at 500 Hz with Runge-Kutta, in JAX on the processor.

Argument: how many, each in a world of its own. Its model is the one from first principles, with the rotors' lag;
targets are told 100 times a second.
"""

import sys

import jax
import numpy as np
import timed
from crazyflow.control import Control
from crazyflow.sim import Sim

TARGETS_HZ = 100
PLACE = (0.0, 0.0, 0.5)

count = int(sys.argv[1])
world = Sim(n_worlds=count, control=Control.state, dynamics="first_principles", integrator="rk4", freq=500)
target = np.zeros((count, 1, 16))
target[..., :3], target[..., 12] = PLACE, 1.0


def fly(seconds: float) -> float:
    world.reset()
    for _ in range(round(seconds * TARGETS_HZ)):
        world.state_control(target)
        world.step(world.freq // TARGETS_HZ)
    away = np.abs(np.asarray(jax.block_until_ready(world.data).states.pos) - np.array(PLACE)).max()
    assert seconds < 4.0 or away < 0.1, away
    return count * seconds


timed.tell(fly, 4.0)
