"""The loop with several vehicles, real ones, over sockets and a clock that are stand-ins."""

import numpy as np
import pytest
from test_loop import CLIENT, Clock, Wire

from sitl.daemon.clock import SLICE_US, SWARM_TURN_S
from sitl.daemon.loop import Ending, Loop
from sitl.daemon.member import Member
from sitl.mavlink.codec import Encoder, Parser, mav, message
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.mavlink.limits import UNLIMITED
from sitl.mavlink.shared import SharedPort
from sitl.onboard.modes import Mode
from sitl.vehicle import Vehicle, load_vehicle

SYSTEMS = (1, 2, 3)
SPEC = load_vehicle("yawsitter-real")
TAKEOFF_US = 1_000_000


def built(system: int) -> Vehicle:
    return Vehicle(SPEC, seed=10 + system, gust_m_s=0.5, overrides={"SIM_SPEED": 1.0})


def member(system: int) -> Member:
    vehicle = built(system)
    endpoint = Endpoint(vehicle, system_id=system, static_peers=[(PortKind.SHARED, CLIENT)])
    return Member(vehicle, endpoint, {PortKind.GCS: system, PortKind.SHARED: "all"})


class Bench:
    def __init__(self) -> None:
        self.clock = Clock()
        self.wire = Wire(self.clock)
        members = [member(system) for system in SYSTEMS]
        shared = SharedPort((m.endpoint for m in members), UNLIMITED)
        self.loop = Loop(
            members,
            self.wire,
            self.clock,
            shared=("all", shared),
            restart=lambda old: member(old.endpoint.system_id),
            turn_s=SWARM_TURN_S,
        )
        self.encoder = Encoder(255, 190)

    @property
    def vehicles(self) -> list[Vehicle]:
        return [m.vehicle for m in self.loop.members]

    def run(self, seconds: float) -> Ending:
        end_s = self.clock() + seconds
        return self.loop.run(lambda: self.clock() >= end_s)

    def command(self, system: int, number: int, *params: float, place="all") -> None:
        named = {f"param{k}": value for k, value in enumerate(params, start=1)}
        data = self.encoder.encode(
            message("COMMAND_LONG", target_system=system, target_component=1, command=number, **named)
        )
        self.wire.script.append((self.clock(), place, data))

    def systems_heard(self) -> set:
        parser = Parser()
        return {frame.system for *_, data in self.wire.outgoing for frame in parser.feed(data)}


@pytest.fixture
def bench() -> Bench:
    return Bench()


def bits(vehicle: Vehicle) -> bytes:
    return np.concatenate([np.asarray(vehicle._loop_array), np.asarray(vehicle._observed_array)]).tobytes()


@pytest.mark.parametrize("speed", [1.0, 7.3, 0.0])
def test_each_vehicle_flies_the_same_bits_as_alone(bench, speed) -> None:
    bench.vehicles[0].parameters.set("SIM_SPEED", speed)
    turns = iter(range(150))
    bench.loop.run(lambda: bench.loop.now_us >= TAKEOFF_US or next(turns, None) is None)
    begun_us = bench.loop.now_us
    for vehicle in bench.vehicles:
        vehicle.commander.takeoff()
        vehicle.commander.arm()
    turns = iter(range(150))
    bench.loop.run(lambda: next(turns, None) is None)
    assert bench.loop.now_us >= begun_us + 2_000_000
    for system, vehicle in zip(SYSTEMS, bench.vehicles, strict=True):
        alone = built(system)
        alone.advance(begun_us)
        alone.commander.takeoff()
        alone.commander.arm()
        alone.advance(vehicle.now_us)
        assert alone.commander.armed
        assert bits(alone) == bits(vehicle)
    assert len({bits(vehicle) for vehicle in bench.vehicles}) == len(SYSTEMS)


def test_all_keep_real_time_in_whole_slices(bench) -> None:
    bench.run(2.0)
    assert {vehicle.now_us for vehicle in bench.vehicles} == {bench.loop.now_us}
    assert bench.loop.now_us == pytest.approx(2_000_000, abs=2 * SLICE_US)
    assert bench.loop.now_us % SLICE_US == 0
    assert bench.loop.lateness.turns == pytest.approx(2.0 / SWARM_TURN_S, abs=2)


def test_who_changes_the_pace_of_one_changes_it_for_all(bench) -> None:
    bench.run(0.1)
    bench.vehicles[1].parameters.set("SIM_SPEED", 4.0)
    bench.vehicles[0].parameters.set("RATE_Y_P", 0.3)  # somebody else has changed something else
    before_us = bench.loop.now_us
    bench.run(1.0)
    assert [vehicle.parameters["SIM_SPEED"] for vehicle in bench.vehicles] == [4.0] * 3
    assert bench.loop.now_us - before_us == pytest.approx(4_000_000, abs=6 * SLICE_US)
    bench.vehicles[2].parameters.set("SIM_PAUSE", 1)
    bench.run(0.1)
    stood_us = bench.loop.now_us
    bench.vehicles[0].parameters.set("SIM_STEP_MS", 6)
    bench.run(0.2)
    assert {vehicle.now_us for vehicle in bench.vehicles} == {bench.loop.now_us}
    assert bench.loop.now_us == stood_us + 6000
    assert bench.vehicles[0].parameters["SIM_STEP_MS"] == 0


def test_a_vehicle_whose_simulation_fails_stands_while_the_others_fly_and_flies_again_after_a_reboot(bench) -> None:
    bench.run(0.1)

    def fail(_until_us: int) -> None:
        raise FloatingPointError("overflow")

    bench.vehicles[1].advance = fail
    bench.run(1.0)
    first, failed, last = bench.vehicles
    assert first.now_us == last.now_us == bench.loop.now_us > failed.now_us
    assert bench.loop.faults == 1
    assert bench.systems_heard() == set(SYSTEMS)
    bench.command(2, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0)
    bench.run(1.0)
    assert bench.vehicles[1] is not failed
    assert bench.vehicles[1].now_us == pytest.approx(1_000_000, abs=3 * SLICE_US)
    assert bench.vehicles[0] is first


def test_a_rebooted_vehicle_takes_on_the_pace_of_the_others_and_answers_at_its_ports(bench) -> None:
    bench.vehicles[0].parameters.set("SIM_SPEED", 3.0)
    bench.run(0.1)
    bench.command(3, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0, place=3)
    bench.run(0.5)
    assert [vehicle.parameters["SIM_SPEED"] for vehicle in bench.vehicles] == [3.0] * 3
    for place in ("all", 3):
        bench.wire.outgoing.clear()
        bench.command(3, mav.MAV_CMD_NAV_TAKEOFF, *(float("nan"),) * 7, place=place)
        bench.run(0.1)
        assert any(address == CLIENT and port == place for _, port, address, _ in bench.wire.outgoing)
    assert bench.vehicles[2].commander.mode is Mode.TAKEOFF


def test_a_vehicle_that_is_shut_down_falls_silent_and_the_last_one_ends_the_loop(bench) -> None:
    bench.run(0.1)
    bench.command(1, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 2.0)
    assert bench.run(0.5) is Ending.STOPPED
    bench.wire.outgoing.clear()
    bench.command(1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, place=1)
    assert bench.run(1.5) is Ending.STOPPED
    assert bench.systems_heard() == {2, 3}
    bench.command(2, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 2.0)
    bench.command(3, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 2.0)
    assert bench.run(1.0) is Ending.SHUTDOWN
