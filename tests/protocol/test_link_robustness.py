"""Whatever arrives, the endpoint stays up, its memory bounded and the vehicle whole."""

import math
import struct
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mavlink_pair import World

from sitl.mavlink.codec import Encoder, by_id, mav, message
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.mavlink.link import OUTBOX_MAX
from sitl.mavlink.peers import LEARNED_MAX
from sitl.vehicle import Vehicle
from sitl.vehicle_spec import VehicleSpec

ADDRESS = ("127.0.0.1", 5000)
IDS = sorted(mav.mavlink_map)


class Bench:
    """One endpoint that all examples of a test throw things at."""

    def __init__(self, spec: VehicleSpec) -> None:
        self.vehicle = Vehicle(spec)
        self.endpoint = Endpoint(self.vehicle)
        self.encoder = Encoder(255, 190)
        self.wall_s = 0.0

    def throw(self, data: bytes, kind: PortKind = PortKind.GCS) -> None:
        self.wall_s += 0.004
        self.endpoint.receive(data, ADDRESS, kind, self.wall_s)
        self.vehicle.advance(self.vehicle.now_us + 4000)
        self.endpoint.poll(self.wall_s)
        assert self.endpoint.faults == 0
        assert all(map(math.isfinite, self.vehicle.snapshot().nav))


@pytest.fixture(scope="module")
def bench(spec: VehicleSpec) -> Bench:
    return Bench(spec)


many = settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@many
@given(data=st.binary(max_size=600))
def test_random_bytes_are_survived(bench: Bench, data: bytes) -> None:
    bench.throw(data)


@many
@given(st.sampled_from(IDS), st.binary(max_size=255), st.booleans())
def test_any_payload_of_any_message_is_survived(bench: Bench, message_id: int, payload: bytes, to_us: bool) -> None:
    definition = by_id(message_id)
    payload = payload.ljust(definition.struct.size, b"\0")[: definition.struct.size]
    if to_us:  # put our address where the message has one
        fields = definition.decode(payload)
        names = {"target_system": 1, "target_component": 1, "target": 1}
        payload = definition.encode(fields._replace(**{k: v for k, v in names.items() if k in fields._fields}))
    bench.throw(bench.encoder.frame(definition, payload))


@many
@given(st.data())
def test_frames_with_flipped_bits_are_survived(bench: Bench, data: st.DataObject) -> None:
    name = data.draw(
        st.sampled_from(["COMMAND_LONG", "MISSION_ITEM_INT", "PARAM_SET", "SET_POSITION_TARGET_LOCAL_NED"])
    )
    frame = bytearray(bench.encoder.encode(message(name, target_system=1, target_component=1)))
    for bit in data.draw(st.lists(st.integers(0, len(frame) * 8 - 1), min_size=1, max_size=5)):
        frame[bit // 8] ^= 1 << bit % 8
    bench.throw(bytes(frame))


WITH_FLOATS = ["COMMAND_LONG", "COMMAND_INT", "MISSION_ITEM_INT", "MISSION_ITEM", "PARAM_SET", "MANUAL_CONTROL"]
WITH_FLOATS += ["SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"]


@pytest.mark.parametrize("name", WITH_FLOATS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45])
def test_no_number_in_any_float_field_does_harm(bench: Bench, name: str, value: float) -> None:
    definition = type(message(name))._definition
    floats = [field.name for field in definition.fields if field.type == "float" and not field.length]
    for fields in ([name] for name in floats):
        for command in (16, 22, 176, 179, 192, 300, 400, 511, 512) if name.startswith("COMMAND") else (16,):
            settings_: dict[str, Any] = dict.fromkeys(fields, value)
            if "command" in [f.name for f in definition.fields]:
                settings_["command"] = command
            settings_ |= {"coordinate_frame": 1} if "coordinate_frame" in [f.name for f in definition.fields] else {}
            m = message(name, **settings_)
            bench.throw(bench.encoder.encode(m))


def test_peers_and_answers_stay_bounded_under_a_flood(spec: VehicleSpec) -> None:
    endpoint = Endpoint(Vehicle(spec))
    encoder = Encoder(255, 190)
    request = encoder.encode(message("COMMAND_LONG", target_system=1, command=512, param1=435.0))
    listing = encoder.encode(message("PARAM_REQUEST_LIST", target_system=1))
    count = encoder.encode(message("MISSION_REQUEST_LIST", target_system=1))
    for k in range(4000):
        for data in (request, listing, count):
            endpoint.receive(data, ("127.0.0.1", 1024 + k % 3000), PortKind.GCS, k * 1e-3)
    assert len(endpoint.peers) <= LEARNED_MAX
    assert len(endpoint.poll(4.0)) <= OUTBOX_MAX
    for k in range(40):
        endpoint.poll(4.0 + k)
    assert len(endpoint.peers) == 0
    assert not endpoint._parameters._listing
    assert not endpoint._missions._downloads


def test_a_mistake_in_a_handler_is_counted_and_the_link_goes_on(spec: VehicleSpec, caplog: Any) -> None:
    world = World(spec)
    station = world.station()
    world.vehicle.commander.arm = None  # type: ignore[method-assign]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [mav.MAV_RESULT_FAILED]
    assert world.endpoint.faults == 1
    assert "COMMAND_LONG" in caplog.text
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 30) == [0]


def test_a_datagram_of_two_frames_and_half_a_third_serves_the_two(spec: VehicleSpec) -> None:
    world = World(spec)
    station = world.station()
    ping = station.encoder.encode(message("PING", seq=1))
    station.send_bytes(ping + ping + ping[: len(ping) // 2])
    world.run(0.05)
    assert len(station.all("PING")) == 2


def test_struct_sizes_agree_with_pymavlink_for_every_message() -> None:
    for message_id in IDS:
        layout = mav.mavlink_map[message_id]
        assert struct.calcsize("<" + by_id(message_id).struct.format[1:]) >= layout.unpacker.size
