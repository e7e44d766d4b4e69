"""Every tool of the ground station against the real vehicle over a bad link, and over one that is too bad.

Stated limit: a loss of 20 %, 5 % doubled and up to 100 ms of delay either way. Beyond it a tool may fail, but in one
line that says what didn't come about, and in bounded time.
"""

from collections.abc import Callable
from typing import Any

import pytest

from gcs_tools import commands, params, upload
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.flight import Flight
from gcs_tools.impairment import Impairment, Wire
from gcs_tools.plan import Item, load
from sitl.mavlink.codec import by_name
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.mavlink.signing import Signer
from sitl.vehicle import Vehicle
from sitl.vehicle_spec import VehicleSpec

ADDRESS = ("127.0.0.1", 14540)
BAD = Impairment(loss=0.2, dup=0.05, jitter_s=0.1)
TURN_S = 0.02
SEEDS = (1, 3, 5)


class Pair:
    """A client and the vehicle, each on its wire; the vehicle's simulation runs in step with the wall."""

    def __init__(self, spec: VehicleSpec, bad: Impairment, *, key: bytes | None = None) -> None:
        signers = [Signer(key) if key else None for _ in range(2)]
        self.vehicle = Vehicle(spec)
        self.endpoint = Endpoint(self.vehicle, signer=signers[0])
        self.client = Client(signer=signers[1])
        self.up: Wire[bytes] = Wire(bad)
        self.down: Wire[bytes] = Wire(bad.reversed())
        self.wall_s = 1_750_000_000.0

    def turn(self) -> None:
        self.wall_s += TURN_S
        for data in self.client.poll(self.wall_s):
            self.up.put(self.wall_s, data)
        for data in self.up.take(self.wall_s):
            self.endpoint.receive(data, ADDRESS, PortKind.ONBOARD, self.wall_s)
        self.vehicle.advance(self.vehicle.now_us + round(TURN_S * 1e6))
        for sent in self.endpoint.poll(self.wall_s):
            self.down.put(self.wall_s, sent.data)
        for data in self.down.take(self.wall_s):
            self.client.receive(data, self.wall_s)

    def run(self, talk: Callable[[Client], Script[Any]], limit_s: float) -> Any:
        def script() -> Script[Any]:
            yield from self.client.connect()
            return (yield from talk(self.client))

        self.client.start(script())
        return self.finish(limit_s)

    def finish(self, limit_s: float) -> Any:
        end_s = self.wall_s + limit_s
        while not self.client.finished:
            assert self.wall_s < end_s, f"neither done nor failed after {limit_s} s"
            self.turn()
        if self.client.fault is not None:
            raise self.client.fault
        return self.client.result


def waypoints(count: int) -> list[Item]:
    return [Item(6, 16, 0.0, 0.0, 0.0, float("nan"), 556_985_000 + k, 373_595_000, 2.0) for k in range(count)]


def take_off_and_land(client: Client) -> Script[None]:
    yield from commands.takeoff(client, height_m=2.0, wait=True)
    yield from commands.land(client, wait=True)


FENCED = load("missions/rectangle-fenced.yaml")


def hand_over_fenced(client: Client) -> Script[None]:
    """After another fence, which is read before it is replaced."""
    yield from upload.upload(
        client, [Item(1, 5003, 50.0 + k, 0.0, 0.0, 0.0, 0, 0, 0.0) for k in range(5)], upload.FENCE
    )
    yield from upload.hand_over(client, FENCED)


INTERVALS = {"ATTITUDE": 50_000, "LOCAL_POSITION_NED": 20_000, "SYS_STATUS": 500_000, "VFR_HUD": -1}
TALKS: dict[str, tuple[Callable[[Client], Script[Any]], float]] = {
    "list all parameters": (params.fetch_all, 20.0),
    "write a parameter": (lambda client: params.store(client, "RATE_Y_P", 0.25), 20.0),
    "upload 100 mission items": (lambda client: upload.upload(client, waypoints(100)), 120.0),
    "hand over a fenced mission": (hand_over_fenced, 60.0),
    "set up streams": (lambda client: client.set_intervals(INTERVALS), 20.0),
    "take off and land": (take_off_and_land, 90.0),
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("what", TALKS)
def test_it_completes_over_the_worst_link_that_is_promised(spec: VehicleSpec, what: str, seed: int) -> None:
    talk, limit_s = TALKS[what]
    pair = Pair(spec, BAD._replace(seed=seed))
    result = pair.run(talk, limit_s)
    if what == "list all parameters":
        assert set(result) == set(pair.vehicle.parameters.names)
    elif what == "write a parameter":
        assert pair.vehicle.parameters["RATE_Y_P"] == 0.25
    elif what == "upload 100 mission items":
        assert [item.x for item in pair.vehicle.mission.items] == [item.x for item in waypoints(100)]
    elif what == "hand over a fenced mission":
        plans = pair.vehicle.plans
        stored, sent = (plans.mission, plans.fence, plans.rally), (FENCED.items, FENCED.fence, FENCED.rally)
        for store, items in zip(stored, sent, strict=True):
            assert [(i.command, i.x, i.y) for i in store.items] == [(i.command, i.x, i.y) for i in items]
    elif what == "set up streams":
        (peer,) = pair.endpoint.peers
        set_to = {name: peer.schedule.interval(by_name(name).id) for name in INTERVALS}
        assert set_to == INTERVALS
    else:
        assert not pair.vehicle.commander.armed
    assert pair.endpoint.faults == 0


@pytest.mark.parametrize("what", TALKS)
def test_over_a_link_beyond_that_it_completes_or_fails_in_one_line(spec: VehicleSpec, what: str) -> None:
    talk, limit_s = TALKS[what]
    told = []
    for loss in (0.6, 0.9):
        pair = Pair(spec, Impairment(loss, 0.05, 0.1))
        try:
            pair.run(talk, 6 * limit_s)
        except LinkError as error:
            told.append(str(error))
        assert pair.endpoint.faults == 0
    assert told
    assert all(text and "\n" not in text for text in told)


def test_a_dead_link_is_told_within_seconds(spec: VehicleSpec) -> None:
    with pytest.raises(LinkError, match="no vehicle heard in 10 s"):
        Pair(spec, Impairment(loss=1.0)).run(params.fetch_all, 15.0)


@pytest.mark.compiled
def test_a_whole_flight_only_loses_samples(spec: VehicleSpec) -> None:
    pair = Pair(spec, BAD)
    flight = Flight(load("missions/rectangle.yaml"), pair.client)
    pair.finish(300.0)
    assert flight.measured_s is not None


@pytest.mark.parametrize("what", TALKS)
def test_a_signed_link_that_keeps_the_order_bears_it_too(spec: VehicleSpec, what: str) -> None:
    """What was overtaken counts as heard before, so a signed link loses nearly all of what is reordered."""
    talk, limit_s = TALKS[what]
    Pair(spec, BAD._replace(jitter_s=0.0), key=b"k" * 32).run(talk, limit_s)


def test_a_client_without_the_key_or_with_another_is_told_so(spec: VehicleSpec) -> None:
    pair = Pair(spec, Impairment(), key=b"k" * 32)
    pair.client = Client()
    with pytest.raises(LinkError, match="--signing-key"):
        pair.run(params.fetch_all, 15.0)
    pair.client = Client(signer=Signer(b"other" * 6 + b"ab"))
    with pytest.raises(LinkError, match="another key"):
        pair.run(params.fetch_all, 15.0)
