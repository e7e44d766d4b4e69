"""Units of the wire: degrees × 1e7, millimetres, centimetres per second, floats of 32 bits."""

import math
import struct

INT32_UNSET = 0x7FFFFFFF  # "no value" in an integer coordinate
UINT16_UNSET = 0xFFFF
INT16_UNSET = 0x7FFF
NAN = math.nan

_FLOAT, _INT = struct.Struct("<f"), struct.Struct("<i")


def clamped(value: float, low: int, high: int) -> int:
    """The nearest integer in low … high; NaN gives `low`."""
    if value >= high:
        return high
    return round(value) if value > low else low


def int16(value: float) -> int:
    """The nearest 16-bit integer that doesn't read as unset."""
    return clamped(value, -32767, 32766)


def uint16(value: float) -> int:
    """The nearest unsigned 16-bit integer that doesn't read as unset."""
    return clamped(value, 0, 65534)


def degE7(degrees: float) -> int:
    """Latitude or longitude."""
    return clamped(degrees * 1e7, -1_800_000_000, 1_800_000_000)


def mm(metres: float) -> int:
    return clamped(metres * 1e3, -2_147_483_647, 2_147_483_646)


def cm_s(metres_per_second: float) -> int:
    """Signed speed in 16 bits."""
    return int16(metres_per_second * 100.0)


def cdeg(heading_rad: float) -> int:
    """Heading in 0 … 35999, unset where it is no number."""
    value = math.degrees(heading_rad) * 100.0
    return round(value) % 36000 if math.isfinite(value) else UINT16_UNSET


def float32(value: float) -> float:
    """What is left of a value in a 32-bit float; beyond its range, infinity."""
    try:
        result: float = _FLOAT.unpack(_FLOAT.pack(value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return result


def float_of_int(value: int) -> float:
    """The float with the bytes of a 32-bit integer: how integer parameters travel in PARAM_VALUE and PARAM_SET."""
    result: float = _FLOAT.unpack(_INT.pack(value))[0]
    return result


def int_of_float(value: float) -> int:
    """The 32-bit integer in the bytes of a float, see `float_of_int`."""
    result: int = _INT.unpack(_FLOAT.pack(value))[0]
    return result


def boot_time_us(time_boot_ms: int, now_us: int) -> int:
    """The 32-bit millisecond stamp as microseconds on the vehicle's clock: of all its wraps the one nearest to now."""
    now_ms = now_us // 1000
    offset = (time_boot_ms - now_ms + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
    return (now_ms + offset) * 1000
