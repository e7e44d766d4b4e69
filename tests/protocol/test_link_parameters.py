"""The parameter protocol, over good and bad links."""

import math
import struct
import zlib
from collections.abc import Callable
from typing import Any

import pytest
from mavlink_pair import Station, Wire, World

from sitl.mavlink.codec import by_name, mav
from sitl.mavlink.endpoint import Identity
from sitl.mavlink.wire import float_of_int
from sitl.onboard.declarations import declarations
from sitl.onboard.parameters import Declaration, Parameters
from sitl.onboard.store import MemoryStore
from sitl.vehicle import Vehicle

REAL32, INT32, UINT32 = 9, 6, 5
UNKNOWN, OUT_OF_RANGE, READ_ONLY, TYPE_MISMATCH = 1, 2, 5, 7
ADDRESS = {"target_system": 1, "target_component": 1}


def value_of(frame: Any) -> float:
    """The value of a PARAM_VALUE frame, bytewise for integers."""
    code = "<i" if frame.message.param_type == INT32 else "<f"
    return float(struct.unpack_from(code, frame.payload)[0])


def values(station: Station) -> dict[str, float]:
    return {f.message.param_id: value_of(f) for f in station.heard if f.name == "PARAM_VALUE"}


def write(world: World, station: Station, name: str, value: float, kind: int = REAL32) -> list[Any]:
    """PARAM_SET; the PARAM_* messages that come back."""
    station.forget()
    encoded = float_of_int(int(value)) if kind == INT32 else value
    station.send("PARAM_SET", **ADDRESS, param_id=name, param_value=encoded, param_type=kind)
    world.run(0.05)
    return [frame.message for frame in station.heard if frame.name.startswith("PARAM_")]


def test_the_list_is_complete_right_and_within_a_third_of_a_second(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    took_s = world.run_until(lambda: len(values(station)) == len(p.names) + 1, 0.5)
    assert took_s <= 0.3
    got = values(station)
    assert {name: got[name] for name in p.names} == {name: p[name] for name in p.names}
    frames = [f.message for f in station.heard if f.name == "PARAM_VALUE" and f.message.param_id != "_HASH_CHECK"]
    assert [m.param_index for m in frames] == list(range(len(p.names)))
    assert {m.param_count for m in frames} == {len(p.names)}
    assert [m.param_id for m in frames] == sorted(p.names)


def test_the_list_is_paced_not_flung(world: World) -> None:
    station = world.station()
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    counts = []
    for _ in range(20):
        before = len(station.all("PARAM_VALUE"))
        world.step()
        counts.append(len(station.all("PARAM_VALUE")) - before)
    assert max(counts) <= 25
    assert sum(counts[:5]) <= 20 + 0.05 * 1000 + 5  # the burst, the rate, and what flows anyway


def test_the_list_comes_at_wall_time_also_while_the_simulation_stands(make_world: Callable[..., World]) -> None:
    world = make_world(speed=0.0)
    station = world.station()
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run_until(lambda: len(values(station)) == len(world.vehicle.parameters.names) + 1, 0.5)


def test_a_list_asked_for_again_while_under_way_starts_anew_with_the_values(world: World) -> None:
    """Without the checksum: whoever asks again had no use for it. As PX4 does."""
    station, p = world.station(), world.vehicle.parameters
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run(0.03)
    station.forget()
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run(0.5)
    assert [m.param_id for m in station.all("PARAM_VALUE")][-len(p.names) :] == list(p.names)
    assert "_HASH_CHECK" not in values(station)
    station.send("PARAM_REQUEST_LIST", **ADDRESS)  # a new one
    world.run(0.05)
    assert "_HASH_CHECK" in values(station)


def test_the_list_is_complete_over_a_link_that_loses_a_fifth(world: World) -> None:
    """As ground stations do: the list once, then what is missing by index."""
    up, down = (Wire(drop=0.2, duplicate=0.1, jitter_s=0.03, seed=s) for s in (5, 6))
    station, p = world.station(up=up, down=down, greeting=False), world.vehicle.parameters
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run(0.5)
    for _ in range(40):
        have = {m.param_index for m in station.all("PARAM_VALUE")}
        missing = set(range(len(p.names))) - have
        if not missing:
            break
        if not have:
            station.send("PARAM_REQUEST_LIST", **ADDRESS)
        for index in sorted(missing)[:10]:
            station.send("PARAM_REQUEST_READ", **ADDRESS, param_index=index)
        world.run(0.1)
    got = values(station)
    assert {name: got[name] for name in p.names} == {name: p[name] for name in p.names}


def test_two_stations_list_at_the_same_time(world: World) -> None:
    one, two = world.station(), world.station()
    for station in (one, two):
        station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run(0.5)
    assert set(values(one)) == set(values(two)) == {*world.vehicle.parameters.names, "_HASH_CHECK"}


def test_one_is_read_by_name_and_by_index(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    index = p.names.index("RATE_Z_P")
    for request in ({"param_id": "RATE_Z_P", "param_index": -1}, {"param_id": "", "param_index": index}):
        station.forget()
        station.send("PARAM_REQUEST_READ", **ADDRESS, **request)
        world.run(0.05)
        [m] = station.all("PARAM_VALUE")
        assert (m.param_id, m.param_index, m.param_value, m.param_type) == ("RATE_Z_P", index, p["RATE_Z_P"], REAL32)


@pytest.mark.parametrize(("name", "index"), [("NO_SUCH_NAME", -1), ("", 999), ("", -5), ("é" * 8, -1)])
def test_reading_what_is_not_there_is_an_error(world: World, name: str, index: int) -> None:
    station = world.station(system=77, component=5)
    station.send("PARAM_REQUEST_READ", **ADDRESS, param_id=name, param_index=index)
    world.run(0.05)
    [m] = station.all("PARAM_ERROR")
    assert (m.error, m.param_index, m.target_system, m.target_component) == (UNKNOWN, index, 77, 5)
    assert station.all("PARAM_VALUE") == []


def test_a_write_is_answered_with_the_value_in_force(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    [m] = write(world, station, "POS_X_P", 1.1)
    assert (m.param_id, m.param_index) == ("POS_X_P", p.names.index("POS_X_P"))
    assert m.param_value == p["POS_X_P"] == struct.unpack("<f", struct.pack("<f", 1.1))[0]
    [again] = write(world, station, "POS_X_P", 1.1)  # no change, but an answer
    assert again == m


@pytest.mark.parametrize("identity", list(Identity))
def test_integers_travel_bytewise_under_both_identities(make_world: Callable[..., World], identity: Identity) -> None:
    world = make_world(identity=identity)
    station, p = world.station(), world.vehicle.parameters
    [m] = write(world, station, "SIM_PAUSE", 1, INT32)
    assert p["SIM_PAUSE"] == 1
    assert m.param_type == INT32
    assert struct.pack("<f", m.param_value) == struct.pack("<i", 1)


REFUSED = [
    ("NO_SUCH_NAME", 1.0, REAL32, UNKNOWN),
    ("NO_SUCH_NAME", 1.0, 2, UNKNOWN),
    ("POS_X_P", math.nan, REAL32, OUT_OF_RANGE),
    ("POS_X_P", math.inf, REAL32, OUT_OF_RANGE),
    ("POS_X_P", -0.5, REAL32, OUT_OF_RANGE),
    ("POS_X_P", 1e9, REAL32, OUT_OF_RANGE),
    ("POS_X_P", 1, INT32, TYPE_MISMATCH),
    ("POS_X_P", 1.0, 10, TYPE_MISMATCH),
    ("SIM_PAUSE", 1.0, REAL32, TYPE_MISMATCH),
    ("SIM_PAUSE", 1.0, 1, TYPE_MISMATCH),
    ("SIM_PAUSE", 7, INT32, OUT_OF_RANGE),
]


@pytest.mark.parametrize(("name", "value", "kind", "error"), REFUSED)
def test_a_refused_write_tells_the_reason_and_keeps_the_old_value(
    world: World, name: str, value: float, kind: int, error: int
) -> None:
    station, p = world.station(), world.vehicle.parameters
    old = {n: p[n] for n in p.names}
    first, *rest = write(world, station, name, value, kind)
    assert type(first).__name__ == "PARAM_ERROR"
    assert (first.param_id, first.error, first.target_system) == (name, error, 255)
    assert {n: p[n] for n in p.names} == old
    if error == UNKNOWN:
        assert rest == []
    else:
        assert values(station) == {name: old[name]}


def test_a_write_to_a_read_only_parameter_is_refused(spec: Any) -> None:
    vehicle = Vehicle(spec)
    fixed = Declaration("MAV_SYS_ID", True, 1, 1, 255, "", "Link", "System id", read_only=True)
    declared = [*declarations(spec.gains, spec.parameters), fixed]
    vehicle.parameters = Parameters(declared, MemoryStore(), "test", vehicle.events)
    world = World(spec, vehicle=vehicle, speed=0.0)
    station = world.station()
    first, second = write(world, station, "MAV_SYS_ID", 5, INT32)
    assert first.error == READ_ONLY
    assert struct.pack("<f", second.param_value) == struct.pack("<i", 1)


def test_every_peer_hears_of_a_change_and_the_writer_once(world: World) -> None:
    one, two = world.station(), world.station()
    two.forget()
    assert len(write(world, one, "VEL_Z_I", 0.25)) == 1
    assert values(two) == {"VEL_Z_I": 0.25}
    one.forget(), two.forget()
    world.vehicle.parameters.set("VEL_Z_I", 0.5)  # from elsewhere
    world.run(0.02)
    assert values(one) == values(two) == {"VEL_Z_I": 0.5}


def test_a_refused_write_is_nobody_elses_news(world: World) -> None:
    one, two = world.station(), world.station()
    two.forget()
    write(world, one, "VEL_Z_I", -5.0)
    assert values(two) == {}


def test_all_gains_can_be_written_and_read_back(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    gains = [f"{loop}_{axis}_{term}" for loop in ("POS", "VEL", "ATT", "RATE") for axis in "XYZ" for term in "PID"]
    for k, name in enumerate(gains):
        [m] = write(world, station, name, 0.01 * (k + 1))
        assert m.param_value == p[name] == pytest.approx(0.01 * (k + 1))


def checksum(p: Parameters) -> int:
    """PX4's crc32part over names and values, bit by bit."""
    crc = 0
    for name in sorted(p.names):
        if name == "SIM_STEP_MS":  # runs down by itself
            continue
        value = struct.pack("<i", int(p[name])) if p.declaration(name).is_int else struct.pack("<f", p[name])
        for byte in name.encode() + value:
            crc ^= byte
            for _ in range(8):
                crc = (crc >> 1) ^ (0xEDB88320 if crc & 1 else 0)
    return crc


def test_the_hash_goes_ahead_of_the_list_and_follows_the_values(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.run(0.02)
    first = next(frame for frame in station.heard if frame.name == "PARAM_VALUE")
    assert (first.message.param_id, first.message.param_index) == ("_HASH_CHECK", 0xFFFF)
    assert first.message.param_type == UINT32
    assert struct.unpack_from("<I", first.payload)[0] == checksum(p)
    write(world, station, "POS_X_P", 3.0)
    station.forget()
    station.send("PARAM_REQUEST_READ", **ADDRESS, param_id="_HASH_CHECK", param_index=-1)
    world.run(0.05)
    [frame] = [frame for frame in station.heard if frame.name == "PARAM_VALUE" and frame.message.param_index == 0xFFFF]
    assert struct.unpack_from("<I", frame.payload)[0] == checksum(p)


def test_a_station_with_a_good_copy_calls_the_list_off(world: World) -> None:
    station = world.station()
    station.send("PARAM_REQUEST_LIST", **ADDRESS)
    world.step()
    station.send("PARAM_SET", **ADDRESS, param_id="_HASH_CHECK", param_type=UINT32)
    world.run(0.02)
    station.forget()
    world.run(0.5)
    assert station.all("PARAM_VALUE") == station.all("PARAM_ERROR") == []


def test_the_hash_stays_while_the_vehicle_changes_what_is_volatile(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    assert [name for name in p.names if p.declaration(name).volatile] == ["SIM_STEP_MS"]
    before = checksum(p)
    write(world, station, "SIM_STEP_MS", 50, INT32)
    station.forget()
    station.send("PARAM_REQUEST_READ", **ADDRESS, param_id="_HASH_CHECK", param_index=-1)
    world.run(0.05)
    [frame] = [frame for frame in station.heard if frame.name == "PARAM_VALUE" and frame.message.param_index == 0xFFFF]
    assert struct.unpack_from("<I", frame.payload)[0] == before


def test_extended_parameters_are_refused(world: World) -> None:
    station = world.station()
    station.send("PARAM_EXT_SET", **ADDRESS, param_id="POS_X_P", param_value="1.0", param_type=REAL32)
    station.send("PARAM_EXT_REQUEST_LIST", **ADDRESS)
    station.send("PARAM_EXT_REQUEST_READ", **ADDRESS, param_id="POS_X_P", param_index=-1)
    world.run(0.05)
    [ack] = station.all("PARAM_EXT_ACK")
    assert (ack.param_id, ack.param_result) == ("POS_X_P", mav.PARAM_ACK_VALUE_UNSUPPORTED)
    assert station.all("PARAM_EXT_VALUE") == []
    assert [text for text in station.texts() if "extended" in text] != []


def test_a_gain_written_over_the_link_acts_in_the_next_control_step(world: World) -> None:
    station = world.station()
    generation = world.vehicle.parameters.generation
    write(world, station, "ATT_Y_P", 2.0)
    assert world.vehicle.parameters.generation == generation + 1
    assert world.vehicle._generation == generation + 1  # the constants in force are the new ones


def test_the_checksum_of_the_test_is_zlibs_without_inversions() -> None:
    assert zlib.crc32(b"abc", 0xFFFFFFFF) ^ 0xFFFFFFFF != zlib.crc32(b"abc")
    assert by_name("PARAM_VALUE").struct.size == 25
    assert mav.MAV_PARAM_TYPE_INT32 == INT32
