"""Component metadata: what the parameters mean, as files that a ground station reads over MAVLink FTP.

COMPONENT_METADATA names the general file, which names the file about the parameters; both come from the declarations.
The formats are mavlink/mavlink's component_metadata/*.schema.json, but for one thing: the schema wants version 3 of the
parameter file, while QGroundControl reads version 1 and nothing else, which is what PX4 writes. They are compressed
with xz and CRC-32 as its check, the only one that QGroundControl's decoder knows.

There is no metadata about events, actuators, commands and peripherals: the vehicle has none of these interfaces.
"""

import lzma
from typing import Any, NamedTuple

import msgspec

from sitl.mavlink.codec import message
from sitl.mavlink.files import MemoryArea
from sitl.mavlink.ftp_payload import crc32
from sitl.mavlink.identity import SIMULATOR, version
from sitl.onboard.parameters import Declaration, Parameters

FOLDER = "metadata"
_PARAMETER = 1  # COMP_METADATA_TYPE
_PLACES_MAX = 7


class Metadata(NamedTuple):
    area: MemoryArea
    uri: str
    crc: int

    @classmethod
    def of(cls, parameters: Parameters) -> "Metadata":
        declared = [parameters.declaration(name) for name in parameters.names]
        inner = _compressed(parameter_file(declared))
        outer = _compressed(general_file(_uri("parameter"), crc32(inner)))
        area = MemoryArea({("general.json.xz",): outer, ("parameter.json.xz",): inner})
        return cls(area, _uri("general"), crc32(outer))

    def message(self, now_us: int) -> Any:
        """COMPONENT_METADATA."""
        boot_ms = now_us // 1000 & 0xFFFFFFFF
        return message("COMPONENT_METADATA", time_boot_ms=boot_ms, file_crc=self.crc, uri=self.uri)


def general_file(parameter_uri: str, parameter_crc: int) -> dict[str, Any]:
    return {
        "version": 1,
        "vendorName": "YawSitter",
        "modelName": SIMULATOR,
        "firmwareVersion": ".".join(map(str, version())),
        "metadataTypes": [{"type": _PARAMETER, "uri": parameter_uri, "fileCrc": parameter_crc}],
    }


def parameter_file(declared: list[Declaration]) -> dict[str, Any]:
    return {"version": 1, "parameters": [_parameter(d) for d in declared]}


def _parameter(d: Declaration) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": d.name,
        "type": "Int32" if d.is_int else "Float",
        "shortDesc": d.short,
        "group": d.group,
        "default": int(d.default) if d.is_int else d.default,
        "min": d.minimum,
        "max": d.maximum,
    }
    if not d.is_int:
        entry["decimalPlaces"] = _places(d)
    for name, value in (("longDesc", d.long), ("units", d.unit), ("readOnly", d.read_only), ("volatile", d.volatile)):
        if value:
            entry[name] = value
    if d.values:
        entry["values"] = [{"value": number, "description": text} for number, text in d.values]
    return entry


def _places(d: Declaration) -> int:
    """Decimal places that show the default and the range's ends, and a hundredth of the default besides."""
    longest = max(len(f"{v:.{_PLACES_MAX}f}".rstrip("0").partition(".")[2]) for v in (d.default, d.minimum, d.maximum))
    return min(_PLACES_MAX, max(3, longest + 1))


def _uri(name: str) -> str:
    return f"mftp:///{FOLDER}/{name}.json.xz"


def _compressed(file: dict[str, Any]) -> bytes:
    return lzma.compress(msgspec.json.encode(file), check=lzma.CHECK_CRC32)
