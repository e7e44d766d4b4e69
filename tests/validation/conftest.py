import pytest

from sitl.vehicle_spec import VehicleSpec, load_vehicle


@pytest.fixture(scope="session")
def spec() -> VehicleSpec:
    return load_vehicle("yawsitter")
