"""RotorPy's batch of vehicles on PyTorch: Crazyflies that its SE(3) controller holds at a place at 100 Hz.

Argument: how many. Integrated by the Runge-Kutta method, the faster of the two that it offers. Where to be is worked
out once and nothing is recorded: its own class for trajectories of a batch computes them one vehicle after the other,
and would cost as much again.
"""

import sys

import timed
import torch
from rotorpy.controllers.quadrotor_control import BatchedSE3Control
from rotorpy.trajectories.batched_traj import BatchedTrajectory
from rotorpy.trajectories.hover_traj import HoverTraj
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import BatchedMultirotor, BatchedMultirotorParams

RATE_HZ = 100
HOVER_RAD_S = 1788.53  # RotorPy's own initial speed of the rotors
OFF_M = 0.3  # from its place, where each begins

count, device = int(sys.argv[1]), torch.device("cpu")
torch.set_num_threads(1)
parameters = BatchedMultirotorParams([quad_params] * count, count, device)
target = BatchedTrajectory([HoverTraj() for _ in range(count)]).update(0.0)


def start() -> dict[str, torch.Tensor]:
    rest = {name: torch.zeros(count, 3, dtype=torch.double) for name in ("v", "w", "wind")}
    upright = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.double).repeat(count, 1)
    rotors = torch.full((count, 4), HOVER_RAD_S, dtype=torch.double)
    return {"x": torch.full((count, 3), OFF_M, dtype=torch.double), "q": upright, "rotor_speeds": rotors, **rest}


def fly(seconds: float) -> float:
    state = start()
    vehicles = BatchedMultirotor(parameters, count, state, device, integrator="rk4")
    controller = BatchedSE3Control(parameters, count, device)
    steps = round(seconds * RATE_HZ)
    for k in range(steps):
        state = vehicles.step(state, controller.update(k / RATE_HZ, state, target), 1.0 / RATE_HZ)
    assert seconds < 3.0 or state["x"].abs().max() < OFF_M / 5.0, "it is not where it should be"
    return count * steps / RATE_HZ


timed.tell(fly, 4.0)
