"""A parameter as it travels: integers as their bytes in the message's float (MAVLink's bytewise encoding, PX4's)."""

from typing import Any, NamedTuple

from sitl.mavlink.codec import mav
from sitl.mavlink.wire import float32, int_of_float

NOT_IN_LIST = 65535  # param_index of a value that isn't part of the list


class Parameter(NamedTuple):
    name: str
    value: float  # an int where is_int
    is_int: bool

    @classmethod
    def of(cls, m: Any) -> "Parameter":
        is_int = m.param_type != mav.MAV_PARAM_TYPE_REAL32
        return cls(m.param_id, int_of_float(m.param_value) if is_int else m.param_value, is_int)

    @property
    def text(self) -> str:
        return number_text(self.value)


def is_hash(m: Any) -> bool:
    """Whether a PARAM_VALUE is the checksum over all parameters, which is none itself."""
    return bool(m.param_index == NOT_IN_LIST and m.param_id.startswith("_"))


def number_text(value: float) -> str:
    """The shortest decimal that reads back as the same 32-bit float."""
    if isinstance(value, int):
        return str(value)
    for digits in range(1, 10):
        short = float(f"{value:.{digits}g}")
        if float32(short) == float32(value):
            return repr(short).removesuffix(".0")
    return repr(value)
