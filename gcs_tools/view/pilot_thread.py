"""The viewer's MAVLink edge: threads that carry a pilot's bytes, and those of a streamed flight, over UDP."""

import threading

from gcs_tools.client import Client, LinkError
from gcs_tools.flight import Flight
from gcs_tools.link import Address, Connection, UdpLink, signer
from gcs_tools.plan import Plan
from gcs_tools.view.pilot import Pilot
from sitl.mavlink.codec import mav

RETRY_S = 1.0  # between two tries to use a link that can't be used
PORT = 18570  # where instance 0 listens for ground stations


def connection_of(base: Connection, instance: int) -> Connection:
    """A vehicle's own link: ports go up with the instances."""
    return base._replace(port=base.port + instance)


class PilotThread(threading.Thread):
    """A vehicle's pilot at work, from `start` to `close`."""

    def __init__(self, connection: Connection, system: int, key: bytes | None = None) -> None:
        super().__init__(name=f"pilot {system}", daemon=True)
        self.connection = connection
        self._system, self._key = system, key
        self.pilot = Pilot(self._client())
        self.sortie: Sortie | None = None
        self._ending = threading.Event()
        self._peer: Address | None = None  # where the vehicle is

    def _client(self) -> Client:
        return Client(self._system, signer(self._key) if self._key is not None else None)

    def run(self) -> None:
        while not self._ending.is_set():
            try:
                with UdpLink(self.connection) as link:
                    while not self._ending.is_set():
                        link.turn(self.pilot.client)
                        self._peer = link.peer
            except LinkError as error:
                self.pilot.fail(str(error))
                self._ending.wait(RETRY_S)

    @property
    def streams(self) -> bool:
        return self.sortie is not None and self.sortie.is_alive()

    def stream(self, plan: Plan) -> None:
        """Fly a plan of timed targets over a link of its own. One at a time: another has to end before."""
        if self._peer is None or self.streams:
            why = "another flight is under way" if self._peer else "no vehicle is there"
            self.pilot.note(mav.MAV_SEVERITY_WARNING, f"{plan.name}: not flown: {why}")
            return
        self.sortie = Sortie(plan, Connection(False, *self._peer), self._client(), self.pilot)
        self.sortie.start()

    def close(self) -> None:
        """A flight that is streamed from here lands."""
        if self.sortie is not None:
            self.sortie.give_up()
            self.sortie.join()
        self._ending.set()
        self.join()


class Sortie(threading.Thread):
    """A streamed flight, told to the pilot's lines. It ends when the vehicle is put into another mode, too."""

    def __init__(self, plan: Plan, connection: Connection, client: Client, pilot: Pilot) -> None:
        super().__init__(name=f"flight of {plan.name}", daemon=True)
        self.flight = Flight(plan, client)
        self._connection, self._pilot = connection, pilot
        self._ending = threading.Event()

    def run(self) -> None:
        flight, client = self.flight, self.flight.client
        try:
            with UdpLink(self._connection) as link:
                while not client.finished:
                    if self._ending.is_set():
                        flight.give_up()
                    link.turn(client)
                link.flush(client)
            if client.fault is not None:
                raise client.fault
            self._pilot.note(mav.MAV_SEVERITY_INFO, f"{flight.plan.name}: {told(flight)}")
        except LinkError as fault:
            self._pilot.note(mav.MAV_SEVERITY_WARNING, f"{flight.plan.name}: {fault}")

    def give_up(self) -> None:
        """The vehicle, if this flight put it into the air, lands where it is."""
        self._ending.set()


class Pilots:
    """A pilot for each vehicle that was ever chosen on the page; it stays, and keeps what was said."""

    def __init__(self, base: Connection, key: bytes | None = None) -> None:
        self._base, self._key = base, key
        self._threads: dict[int, PilotThread] = {}

    def of(self, instance: int) -> PilotThread:
        thread = self._threads.get(instance)
        if thread is None:
            thread = PilotThread(connection_of(self._base, instance), instance + 1, self._key)
            self._threads[instance] = thread
            thread.start()
        return thread

    def close(self) -> None:
        for thread in self._threads.values():
            thread.close()


def told(flight: Flight) -> str:
    """The outcome of a flown flight in a line."""
    errors = " / ".join(f"{1000.0 * x:.1f}" for x in flight.metrics().mae)
    return f"flown; mean absolute error north / east / down {errors} mm"
