"""Each browser's camera: free, or one that goes with the vehicle that is shown.

A camera that goes with the vehicle may still be turned and zoomed by hand. The browser reports every pose, among them
the ones it was told, later; so a report whose offset from what it looks at is none of those told of late is the user's,
and becomes the offset from then on. While the user drags, the camera is left alone.
"""

import math
from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.view.topics import Quadruple, Triple
from gcs_tools.view.vehicle import Vehicle
from sitl.quaternion import rotate

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

Vector = NDArray[np.float64]
UP_N = (0.0, 0.0, -1.0)
NORTH_N = (1.0, 0.0, 0.0)
FOLLOWING = ("chase", "side", "top")
NAMES = (*FOLLOWING, "onboard", "free")
FIRST = "chase"
OFFSETS_H_M = {"chase": (-1.25, 0.45, -0.5), "side": (0.0, 1.6, -0.1), "top": (0.0, 0.0, -6.0)}
"""From the vehicle to the camera: ahead (where the belly faces), right, down."""
ONBOARD_B_M = (0.06, 0.0, 0.075)  # before the belly, below the nose
TURN_TAU_S = 0.8  # with which chase and side turn after the vehicle's heading
SAME = 0.005  # two offsets that differ by less of their length are one
REMEMBERED_S = 1.5  # how late a browser may report what it was told
AHEAD, PATIENCE_S = 3, 0.5  # poses told that a browser has not yet drawn: then wait, or a slow one never sees the hand
LET_GO_S = 0.25  # after the last report by hand
SETTLE_S = 1.0  # after a choice, while reports are still of the camera before


class View(NamedTuple):
    """Where a camera is, what it looks at, and which way is up, in the scene's axes."""

    position: Vector
    look_at: Vector
    up: Triple


def turned(offset: Triple | Vector, heading_rad: float) -> Vector:
    """A vector ahead, right, down as north, east, down."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([c * offset[0] - s * offset[1], s * offset[0] + c * offset[1], offset[2]])


def onboard(position: Vector, q_NB: Quadruple) -> View:
    """Out of the belly, which in hover faces ahead; the nose is up."""
    ahead = np.array(rotate(q_NB, (0.0, 0.0, 1.0)))
    eye = position + rotate(q_NB, ONBOARD_B_M)
    return View(eye, eye + ahead, rotate(q_NB, (1.0, 0.0, 0.0)))


class Rig:
    """One browser's camera, without the browser. Times are wall time."""

    def __init__(self) -> None:
        self.name = FIRST
        self._offsets = {name: np.array(offset) for name, offset in OFFSETS_H_M.items()}
        self._heading_rad: float | None = None
        self._wall_s = 0.0
        self._last: Vector | None = None
        self._told: deque[tuple[float, Vector]] = deque()
        self._ahead = 0  # poses told since the last report
        self._by_hand_s = float("-inf")
        self._settled_s: float | None = None  # None: not yet begun

    def choose(self, name: str) -> None:
        """Switch, and forget what the user made of this camera before."""
        self.name = name
        if name in OFFSETS_H_M:
            self._offsets[name] = np.array(OFFSETS_H_M[name])
        self._heading_rad = self._settled_s = None
        self._by_hand_s = float("-inf")
        self._told.clear()
        self._ahead, self._last = 0, None

    def view(self, position: Vector, q_NB: Quadruple, heading_rad: float, wall_s: float) -> View | None:
        """Where the camera should be now; None: leave it where it is."""
        if self.name == "onboard":
            return onboard(position, q_NB)
        if self.name not in FOLLOWING or wall_s < self._by_hand_s + LET_GO_S:
            return None
        if self._settled_s is None:
            self._settled_s = wall_s + SETTLE_S
        self._turn(heading_rad, wall_s)
        if self._ahead >= AHEAD and wall_s < self._told[-1][0] + PATIENCE_S:
            return None
        offset = turned(self._offsets[self.name], self._heading_rad or 0.0)
        told = position + offset
        self._ahead += self._last is None or not np.allclose(told, self._last)  # viser sends what is new
        self._last = told
        while self._told and self._told[0][0] < wall_s - REMEMBERED_S:
            self._told.popleft()
        self._told.append((wall_s, offset))
        return View(told, position, NORTH_N if self.name == "top" else UP_N)

    def _turn(self, heading_rad: float, wall_s: float) -> None:
        """Go after the heading; the camera from above keeps north up."""
        if self.name == "top":
            self._heading_rad = 0.0
        elif self._heading_rad is None:
            self._heading_rad = heading_rad
        else:
            error = math.remainder(heading_rad - self._heading_rad, math.tau)
            self._heading_rad += error * (1.0 - math.exp(-(wall_s - self._wall_s) / TURN_TAU_S))
        self._wall_s = wall_s

    def reported(self, position: Vector, look_at: Vector, wall_s: float) -> None:
        """The browser's pose, its own or as it was told."""
        self._ahead = 0
        if self.name not in FOLLOWING or self._settled_s is None or wall_s < self._settled_s:
            return
        offset = position - look_at
        tolerance = SAME * float(np.linalg.norm(offset))
        if all(np.linalg.norm(offset - told) > tolerance for _, told in self._told):
            self._by_hand_s = wall_s
            self._offsets[self.name] = turned(offset, -(self._heading_rad or 0.0))


class Cameras:
    """The rigs of all browsers, and the buttons that choose among cameras in each."""

    def __init__(self, page: "Page") -> None:
        self._page = page
        self._rigs: dict[int, Rig] = {}
        page.server.on_client_connect(self._connected)
        page.server.on_client_disconnect(self._gone)

    def _connected(self, client: Any) -> None:
        rig = Rig()
        buttons = client.gui.add_button_group("Camera", NAMES, order=self._page.CAMERA_ORDER)

        @buttons.on_click
        def _(event: Any) -> None:
            rig.choose(event.target.value)
            if event.target.value == "free":
                client.camera.up_direction = UP_N

        @client.camera.on_update
        async def _(camera: Any) -> None:
            rig.reported(camera.position, camera.look_at, self._page.wall_s)

        self._rigs[client.client_id] = rig

    def _gone(self, client: Any) -> None:
        self._rigs.pop(client.client_id, None)

    def update(self, vehicle: Vehicle | None, wall_s: float) -> None:
        if vehicle is None or (pose := self._page.scene.pose(vehicle)) is None:
            return
        position, q_NB, heading_rad = pose
        for client_id, client in self._page.server.get_clients().items():
            rig = self._rigs.get(client_id)
            view = rig.view(position, q_NB, heading_rad, wall_s) if rig else None
            if view is not None:
                with client.atomic():
                    client.camera.up_direction = view.up
                    client.camera.position = view.position
                    client.camera.look_at = view.look_at
