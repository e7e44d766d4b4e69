"""Udaan: its quadrotor to a place by its own position and attitude controllers at 200 Hz, four Euler steps each."""

import numpy as np
import timed
from udaan.models.quadrotor.base import QuadrotorBase

PLACE = np.array([1.0, 1.0, 1.5])


def fly(seconds: float) -> float:
    vehicle = QuadrotorBase()
    vehicle.position_controller.setpoint = lambda _t: (PLACE, np.zeros(3), np.zeros(3))
    vehicle.simulate(seconds, position=np.zeros(3))
    away = np.abs(vehicle.state.position - PLACE).max()
    assert seconds < 10.0 or away < 0.1, vehicle.state.position
    return float(vehicle.t)


timed.tell(fly, 10.0)
