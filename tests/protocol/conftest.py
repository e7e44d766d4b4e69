"""The real vehicle and its endpoint, with injected time."""

from collections.abc import Callable

import pytest
from mavlink_pair import World

from sitl.vehicle import load_vehicle
from sitl.vehicle_spec import VehicleSpec


@pytest.fixture(scope="session")
def spec() -> VehicleSpec:
    return load_vehicle("yawsitter")


@pytest.fixture
def make_world(spec: VehicleSpec) -> Callable[..., World]:
    """A world; whatever a test did, no frame may have been handled badly."""
    worlds: list[World] = []

    def make(**settings: object) -> World:
        worlds.append(World(spec, **settings))  # type: ignore[arg-type]
        return worlds[-1]

    yield make  # type: ignore[misc]
    for world in worlds:
        assert world.endpoint.faults == 0


@pytest.fixture
def world(make_world: Callable[..., World]) -> World:
    return make_world()
