"""RotorPy: its Crazyflie on its circle, with its SE(3) controller at 100 Hz and scipy's adaptive integration."""

import timed
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.trajectories.circular_traj import ThreeDCircularTraj
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor


def fly(seconds: float) -> float:
    world = Environment(Multirotor(quad_params), SE3Control(quad_params), ThreeDCircularTraj(), sim_rate=100)
    return float(world.run(t_final=seconds, plot=False, terminate=False, verbose=False)["time"][-1])


timed.tell(fly, 5.0)
