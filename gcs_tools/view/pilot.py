"""The page's hand on one vehicle: takes requests from any thread, has them done over MAVLink, tells what came of them.

It is one script of a Client (see client.py), without sockets, threads or clock; pilot_thread.py has these. Within it
two others take turns: the newest command, and parameters that are written one after the other. So a vehicle that stands
still can be set going while a command waits for it.
"""

import math
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from gcs_tools import params
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.parameter import number_text
from gcs_tools.vehicle_state import Text
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

TURN_S = 0.02  # between two looks at what is asked for
CALL_S = 3.0  # without an answer, after which nobody is there
HUSH_S = 1.0  # between two requests for quiet
LINES = 200  # kept
_STARTING = (mav.MAV_STATE_UNINIT, mav.MAV_STATE_BOOT, mav.MAV_STATE_CALIBRATING)

Task = Callable[[Client], Script[str]]


class Line(NamedTuple):
    """Something to be read: what the vehicle said, or what came of a request."""

    number: int
    wall_s: float
    severity: int  # MAV_SEVERITY
    text: str
    own: bool  # of a request of ours


class _Running(NamedTuple):
    script: Script[str]
    asked_s: float


class Pilot:
    """`up`: the vehicle is heard, its parameters are known, and requests are carried out. `trouble`: why not.

    `ask`, `write`, `value` and all attributes are for any thread; whoever has the client's link polls it in one.
    What is asked of a vehicle that is not `up` is dropped.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.up = False
        self.trouble = "no answer yet"
        self.lines: tuple[Line, ...] = ()
        self.completed = 0  # commands carried out or refused
        self._number = 0
        self._lock = threading.Lock()
        self._asked: SimpleQueue[Task] = SimpleQueue()
        self._command: _Running | None = None
        self._wanted: dict[str, float] = {}  # parameters still to be written, in order
        self._writing: tuple[str, float] | None = None
        self._write: _Running | None = None
        self._introductions = 0
        self._text: Text | None = None  # the newest
        self._hush_s = -math.inf
        client.on["STATUSTEXT"] = self._said
        client.on["ATTITUDE"] = self._hush
        client.start(self._serve())

    # What the page does.

    def ask(self, task: Task) -> None:
        """Have a command carried out, in place of one that is still waiting for its answer."""
        if self.up:
            self._asked.put(task)

    def write(self, name: str, value: float) -> None:
        """Have a parameter written. Of several values asked for before the first is sent, the last one is written."""
        with self._lock:
            if self.up:
                self._wanted.pop(name, None)  # so that it comes after what was asked for meanwhile
                self._wanted[name] = value

    def value(self, name: str) -> float | None:
        """What a parameter is to be, or is; None where that isn't known. As short a number as means the same."""
        with self._lock:
            if name in self._wanted:
                return self._wanted[name]
            if self._writing is not None and self._writing[0] == name:
                return self._writing[1]
        parameter = self.client.vehicle.parameters.get(name)
        return None if parameter is None else float(number_text(parameter.value))

    def fail(self, why: str) -> None:
        """The link can't be used."""
        if self.up:
            self.note(mav.MAV_SEVERITY_WARNING, f"MAVLink: {why}")
        self.up, self.trouble = False, why

    def note(self, severity: int, text: str, own: bool = True) -> None:
        with self._lock:
            self._number += 1
            line = Line(self._number, self.client.wall_s, severity, text, own)
            self.lines = (*self.lines[-LINES + 1 :], line)

    # The script.

    def _serve(self) -> Script[None]:
        """For ever: find the vehicle, learn its parameters, do what is asked; once more whenever it was lost."""
        while True:
            try:
                introductions = yield from self._meet()
                while self._introductions == introductions:  # one that introduces itself anew was started anew
                    if self.client.vehicle.status in _STARTING:
                        raise LinkError("the vehicle is starting")
                    yield min(self._advance_command(), self._advance_write(), self.client.wall_s + TURN_S)
            except LinkError as fault:
                self._drop(fault)
                yield from self._silence()

    def _meet(self) -> Script[int]:
        yield from self.client.connect(CALL_S)
        self._hush(None)
        introductions = self._introductions
        yield from params.fetch_all(self.client)
        self.trouble, self.up = "", True
        return introductions

    def _silence(self) -> Script[None]:
        """Until something is heard."""
        heard_s = self.client.vehicle.heard_s
        while self.client.vehicle.heard_s == heard_s:
            try:
                yield math.inf
            except LinkError:  # it is thrown in at every poll for as long as nothing is heard
                continue

    def _drop(self, fault: LinkError) -> None:
        """Nothing that is under way or asked for now may take effect later, when the vehicle is back."""
        for running in (self._command, self._write):
            if running is not None:
                running.script.close()
        self._command = self._write = None
        with self._lock:
            self._writing = None
            self._wanted.clear()
        while not self._asked.empty():
            self._asked.get()
        self.fail(str(fault))

    def _advance_command(self) -> float:
        try:
            while True:
                task = self._asked.get_nowait()
                if self._command is not None:
                    self._command.script.close()
                self._command = _Running(task(self.client), self.client.wall_s)
        except Empty:
            pass
        if self._command is None:
            return math.inf
        try:
            return next(self._command.script)
        except StopIteration as stop:
            self.note(mav.MAV_SEVERITY_INFO, stop.value)
        except LinkError as fault:
            self._refused(self._command, fault)
        self._command = None
        self.completed += 1
        return self.client.wall_s

    def _advance_write(self) -> float:
        client = self.client
        with self._lock:
            if self._write is None and self._wanted:
                name = next(iter(self._wanted))
                self._writing = (name, self._wanted.pop(name))
                self._write = _Running(self._put(*self._writing), client.wall_s)
        if self._write is None:
            return math.inf
        try:
            return next(self._write.script)
        except StopIteration:
            pass
        except LinkError as fault:
            self._refused(self._write, fault)
        with self._lock:
            self._write, self._writing = None, None
        return client.wall_s

    def _put(self, name: str, value: float) -> Script[str]:
        old = self.client.vehicle.parameters.get(name)
        if old is None:
            raise LinkError(f"{name}: the vehicle has no such parameter")
        return (yield from params.write(self.client, old, value)).text

    def _refused(self, running: _Running, fault: LinkError) -> None:
        """One line for the refusal and its reason, which was told apart."""
        text = str(fault)
        with self._lock:
            kept = (x for x in self.lines if x.own or x.wall_s < running.asked_s or x.text not in text)
            self.lines = tuple(kept)
        self.note(mav.MAV_SEVERITY_WARNING, text)

    # What it hears beside.

    def _said(self, m: Any) -> None:
        texts = self.client.vehicle.texts
        if not texts or texts[-1] is self._text:
            return  # a piece of a longer one
        self._text = texts[-1]
        self._introductions += self._text.introduces
        self.note(self._text.severity, self._text.text, own=False)

    def _hush(self, _m: Any) -> None:
        """The page draws from telemetry: attitude and position needn't come a second time."""
        if self.client.wall_s >= self._hush_s:
            self._hush_s = self.client.wall_s + HUSH_S
            stream = mav.MAV_DATA_STREAM_ALL
            self.client.send(
                codec.message("REQUEST_DATA_STREAM", req_stream_id=stream, start_stop=0, **self.client.address())
            )
