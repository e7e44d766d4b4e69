"""Constants for compiled code, packed so that passing them costs nothing.

Numba takes a nested NamedTuple apart on every call (15 µs for the plant and the controller together, more than ten
control steps of work would allow); a structured array is passed as one pointer. Both give the same
`x.airframe.mass_kg` inside a kernel, so kernels don't care which they get.
"""

from typing import Any, TypeVar

import numba
import numpy as np

T = TypeVar("T", bound=tuple[Any, ...])
_DTYPES: dict[np.dtype[Any], np.dtype[Any]] = {}  # numba knows the same object at once, an equal one after 3 µs


def _dtype(value: Any) -> Any:
    if hasattr(value, "_fields"):
        return np.dtype([(name, _dtype(field)) for name, field in zip(value._fields, value, strict=True)], align=True)
    if isinstance(value, np.ndarray):
        return np.dtype((np.float64, value.shape))
    return np.dtype(np.int64 if isinstance(value, int) else np.float64)


def _fill(record: Any, value: Any) -> None:
    for name, field in zip(value._fields, value, strict=True):
        if hasattr(field, "_fields"):
            _fill(record[name], field)
        else:
            record[name] = field


def packed(value: T) -> Any:
    """A one-element sequence whose [0] has the fields of the NamedTuple `value` (numbers, arrays, NamedTuples).

    A structured array for compiled code; with the JIT off a tuple holding `value` itself, as numpy scalars are slow.
    """
    if numba.config.DISABLE_JIT:
        return (value,)
    dtype = _dtype(value)
    array = np.zeros(1, dtype=_DTYPES.setdefault(dtype, dtype))
    _fill(array[0], value)
    return array
