"""The YawSitter simulator. `from sitl import fly, Vehicle`: flights from Python (docs/python.md).

What is named here is imported when it is first asked for, so that `import sitl` and `sitl --help` stay fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sitl.api import FlightError, Flown, attitude, body_rates, fly
    from sitl.control.guidance import Actuation
    from sitl.strict_yaml import ConfigError
    from sitl.vehicle import Vehicle, load_vehicle

_FROM = {
    "Actuation": "sitl.control.guidance",
    "ConfigError": "sitl.strict_yaml",
    "FlightError": "sitl.api",
    "Flown": "sitl.api",
    "Vehicle": "sitl.vehicle",
    "attitude": "sitl.api",
    "body_rates": "sitl.api",
    "fly": "sitl.api",
    "load_vehicle": "sitl.vehicle",
}
__all__ = [
    "Actuation", "ConfigError", "FlightError", "Flown", "Vehicle", "attitude", "body_rates", "fly", "load_vehicle",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _FROM:
        raise AttributeError(f"module 'sitl' has no attribute '{name}'")
    return getattr(import_module(_FROM[name]), name)


def __dir__() -> list[str]:
    return sorted((*globals(), *__all__))
