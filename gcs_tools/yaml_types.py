"""What may stand in a field of the project's own mission files, by unit and meaning."""

import math
from typing import Annotated

import msgspec

from gcs_tools.plan import LOCAL_SCALE

Length = Annotated[float, msgspec.Meta(ge=-10_000.0, le=10_000.0)]
Down = Annotated[float, msgspec.Meta(ge=-1000.0, le=0.0)]
Height = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
Instant = Annotated[float, msgspec.Meta(ge=0.0, le=36_000.0)]
Duration = Annotated[float, msgspec.Meta(gt=0.0, le=36_000.0)]
Heading = Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=80)]
NAN = math.nan


class Struct(msgspec.Struct, forbid_unknown_fields=True):
    pass


def wire_xy(north_m: float, east_m: float) -> tuple[int, int]:
    """x and y of an item in the local frame."""
    return round(north_m * LOCAL_SCALE), round(east_m * LOCAL_SCALE)
