"""One vehicle as the dashboard looks at it: its client, what is made of what it tells, and what is asked of it."""

import math

from gcs_tools.client import LOST_S, Client, LinkError, Script
from gcs_tools.flight import UNWANTED
from gcs_tools.watch.instruments import Instruments
from gcs_tools.watch.traffic import Traffic
from sitl.mavlink.codec import Frame, mav

TURN_S = 0.25  # between two looks at what is to be asked
PING_S = 1.0
REASON_S = 5.0  # between two questions why it isn't ready
AGAIN_S = 5.0  # after which streams that couldn't be had are asked for again

# Intervals of the chosen vehicle's streams, and of all others' [µs of vehicle time at real time]; the rest is off
CHOSEN = {
    "LOCAL_POSITION_NED": 100_000,
    "POSITION_TARGET_LOCAL_NED": 100_000,
    "DEBUG_VECT": 100_000,
    "ATTITUDE": 100_000,
    "SYS_STATUS": 500_000,
    "EXTENDED_SYS_STATE": 500_000,
    "MISSION_CURRENT": 500_000,
    "SYSTEM_TIME": 1_000_000,
    "WIND_COV": 500_000,
    "ESTIMATOR_STATUS": 1_000_000,
}
OTHERS = {
    "LOCAL_POSITION_NED": 500_000,
    "POSITION_TARGET_LOCAL_NED": 500_000,
    "SYS_STATUS": 1_000_000,
    "EXTENDED_SYS_STATE": 1_000_000,
    "MISSION_CURRENT": 1_000_000,
    "SYSTEM_TIME": 1_000_000,
}


class Seen:
    """`chosen`: shown in full, so that more is asked of it."""

    def __init__(self, client: Client) -> None:
        self.client, self.vehicle = client, client.vehicle
        self.chosen = False
        self.trouble = ""  # why it can't be asked for its streams
        self.not_ready = ""  # the vehicle's reason
        self.traffic = Traffic()
        self.instruments = Instruments(client)
        self._scale = 1.0  # streams run on vehicle time: their intervals grow with its rate
        self._introductions = 0
        self._ping_s = self._reason_s = -math.inf
        client.on_frame = self._hear

    @property
    def system(self) -> int:
        return self.client.system or 0

    def age_s(self, wall_s: float) -> float:
        """How long nothing has been heard."""
        return wall_s - self.vehicle.heard_s if self.vehicle.heard_s is not None else math.inf

    def is_lost(self, wall_s: float) -> bool:
        return self.age_s(wall_s) > LOST_S

    def leave(self) -> None:
        """Give the vehicle its own stream rates back."""
        if not self.is_lost(self.client.wall_s):
            self.client.send_intervals(dict.fromkeys(self._wanted(), 0))

    def attend(self) -> Script[None]:
        """Ask for what is to be shown, for as long as it lasts: a vehicle that was lost is asked again."""
        client = self.client
        while True:
            try:
                yield from self._until_heard()
                yield from client.connect(math.inf)
                asked = self._asked()
                yield from client.set_intervals(self._wanted())
                self.trouble = ""
                yield from client.pause(TURN_S)
                for name in set(CHOSEN) - self.traffic.names:
                    client.request(name)  # of a vehicle whose clock stands still nothing flows
                while asked == self._asked():
                    self._ping()
                    yield from self._why_not_ready()
                    yield from client.pause(TURN_S)
            except LinkError as error:
                self.trouble = "" if self.is_lost(client.wall_s) else str(error)
            if self.trouble:
                yield from self._rest()

    def _until_heard(self) -> Script[None]:
        if not self.is_lost(self.client.wall_s):
            return
        since_s = self.vehicle.heard_s or self.client.wall_s
        yield from self.client.wait(lambda: not self.is_lost(self.client.wall_s), math.inf, "")
        self.instruments.note(f"heard again after {self.client.wall_s - since_s:.0f} s")

    def _rest(self) -> Script[None]:
        try:
            yield from self.client.pause(AGAIN_S)
        except LinkError:
            self.trouble = ""  # lost, which shows by itself

    def _wanted(self) -> dict[str, int]:
        wanted = CHOSEN if self.chosen else OTHERS
        return dict.fromkeys(UNWANTED, -1) | {name: round(us * self._scale) for name, us in wanted.items()}

    def _asked(self) -> tuple[bool, float, int]:
        """What the streams' rates depend on; where it changes they are asked for anew.

        A vehicle that introduces itself once more has forgotten them.
        """
        rate = max(1.0, self.instruments.rate(self.client.wall_s) or 1.0)
        if not 0.5 <= rate / self._scale <= 2.0:
            self._scale = rate
        introductions = sum(text.introduces for text in self.vehicle.texts)
        if introductions != self._introductions:
            self._introductions = introductions
            self.traffic.restart()
        return self.chosen, self._scale, self._introductions

    def _ping(self) -> None:
        """TIMESYNC names nobody: every vehicle at the port answers, so one asks for all."""
        if self.chosen and self.client.wall_s - self._ping_s >= PING_S:
            self._ping_s = self.client.wall_s
            self.instruments.ping()

    def _why_not_ready(self) -> Script[None]:
        """SYS_STATUS tells that it isn't; running the checks makes it say why."""
        client, v = self.client, self.vehicle
        if v.ready is not False or v.armed:
            self.not_ready = ""
        elif client.wall_s - self._reason_s >= REASON_S:
            self._reason_s = client.wall_s
            yield from client.ask(mav.MAV_CMD_RUN_PREARM_CHECKS)
            yield from client.pause(TURN_S)
            self.not_ready = v.reasons_since(self._reason_s) or self.not_ready

    def _hear(self, frame: Frame) -> None:
        self.traffic.hear(frame, self.client.wall_s)
