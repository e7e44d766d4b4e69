"""MAVSDK of either generation behind one face.

Since version 4 `mavsdk` binds the library in process; until 3 it was a wrapper around the mavsdk_server binary, which
lives on as `mavsdk_grpc`. Their plugins have the same methods and arguments, apart from what is evened out here.
"""

import asyncio
import contextlib
import functools
import importlib
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from enum import Enum
from types import ModuleType
from typing import Any

CONNECT_S = 30.0
STEP_S = 60.0  # wall time for anything that takes a flight
PLUGINS = (
    "action",
    "ftp",
    "geofence",
    "info",
    "log_files",
    "mission",
    "offboard",
    "param",
    "telemetry",
)


class Generation(Enum):
    """A client of the conformance matrix."""

    GRPC = "MAVSDK 3"
    NATIVE = "MAVSDK 4"


class Drone:
    """One connected vehicle: the plugins as attributes, their types in `types`, streams by name."""

    action: Any
    ftp: Any
    geofence: Any
    info: Any
    log_files: Any
    mission: Any
    offboard: Any
    param: Any
    telemetry: Any

    def __init__(self, generation: Generation) -> None:
        self.generation = generation

    @classmethod
    @contextlib.asynccontextmanager
    async def connected(cls, generation: Generation, address: str) -> AsyncIterator["Drone"]:
        drone = cls(generation)
        async with drone._grpc(address) if generation is Generation.GRPC else drone._native(address):
            yield drone

    @contextlib.asynccontextmanager
    async def _native(self, address: str) -> AsyncIterator[None]:
        from mavsdk import ComponentType, Configuration
        from mavsdk.asyncio import Mavsdk

        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(address)
            system = await mavsdk.first_autopilot(CONNECT_S)
            assert system is not None, f"nothing heard at {address} in {CONNECT_S:g} s"
            for name in PLUGINS:
                module = importlib.import_module(f"mavsdk.asyncio.plugins.{name}")
                plugin = "".join(part.title() for part in name.split("_")) + "Async"
                setattr(self, name, getattr(module, plugin)(system))
            yield
            for name in PLUGINS:
                getattr(self, name).destroy()

    @contextlib.asynccontextmanager
    async def _grpc(self, address: str) -> AsyncIterator[None]:
        from mavsdk_grpc import System

        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        system = System(port=port)
        try:
            await asyncio.wait_for(system.connect(address), CONNECT_S)
            await until(system.core.connection_state(), lambda state: state.is_connected, CONNECT_S)
            for name in PLUGINS:
                setattr(self, name, getattr(system, name))
            yield
        finally:
            server = system._server_process
            system._stop_mavsdk_server()
            if server is not None:
                server.wait()

    def types(self, plugin: str) -> ModuleType:
        """The module with the plugin's types and errors."""
        root = "mavsdk_grpc" if self.generation is Generation.GRPC else "mavsdk.plugins"
        return importlib.import_module(f"{root}.{plugin}")

    def stream(self, plugin: str, name: str) -> AsyncIterator[Any]:
        prefix = "" if self.generation is Generation.GRPC else "subscribe_"
        stream: AsyncIterator[Any] = getattr(getattr(self, plugin), prefix + name)()
        return stream

    async def told(self, name: str, fits: Callable[[Any], bool] = lambda _: True, limit_s: float = STEP_S) -> Any:
        """The first value of a telemetry stream that fits."""
        return await until(self.stream("telemetry", name), fits, limit_s, name)

    async def mode(self, name: str) -> None:
        """Wait for a flight mode."""
        types = self.types("telemetry")
        await self.told("flight_mode", lambda mode: mode == types.FlightMode[name])

    async def airborne(self, height_m: float = 3.0) -> Any:
        """Hovering in Hold, taken off if need be; the position."""
        landed = self.types("telemetry").LandedState
        if await self.told("landed_state") == landed.ON_GROUND:
            await self.action.set_takeoff_altitude(height_m)
            await self.action.arm()
            await self.action.takeoff()
            await self.told("position", lambda p: p.relative_altitude_m > 0.95 * height_m)
            await self.mode("HOLD")
        return await self.told("position")


async def until(stream: AsyncIterator[Any], fits: Callable[[Any], bool], limit_s: float, what: str = "") -> Any:
    """The first value that fits; the last one seen is in the error."""
    last: Any = "nothing"

    async def search() -> Any:
        nonlocal last
        async for value in stream:
            last = value
            if fits(value):
                return value
        raise AssertionError(f"{what} ended with {last}")

    try:
        return await asyncio.wait_for(search(), limit_s)
    except TimeoutError:
        raise AssertionError(
            f"{what or stream} did not come to what it should in {limit_s:g} s; last: {last}"
        ) from None


def flown(test: Callable[[Drone], Awaitable[None]]) -> Callable[[Any], None]:
    """A coroutine as a test, run in the loop of the fixture `drone`."""

    @functools.wraps(test)
    def run(drone: Any) -> None:
        runner, connected = drone
        runner.run(test(connected))

    return run
