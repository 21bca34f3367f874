"""Tables in C of what the services on the bus offer: identity, measurements, trouble codes that there can be, the calibration's numbers."""

import importlib.metadata
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Final

from dbc.database import Database
from deploy.c.tables import constant, numbered, rows
from ecu.calibration import Calibration
from ecu.codes import TroubleCodes
from ecu.measure.measurements import FLOAT, Measurement, measurements
from ecu.measure.parameters import image_of
from ecu.uds.identity import (
    CALIBRATION_CHECKSUM,
    CALIBRATION_NAME,
    MACHINE,
    MEASURED_BASE,
    SOFTWARE_VERSION,
    machine_name,
)

_NOTE: Final = "/* Written by `loaderhil export-c` from the ECU's tables and the calibration; edit those, not this file. */\n"
_TYPES: Final = """\
typedef struct {
    uint16_t place; /* of its value among the inputs or the values of a cycle */
    bool is_input;
    bool is_float; /* else a byte; the floats come first */
} Measured;

typedef struct {
    uint16_t identifier; /* of UDS */
    uint16_t length;
    const uint8_t *bytes;
} Identity;

typedef struct {
    uint32_t spn;
    uint8_t mode;
} PossibleCode;
"""


def service_files(
    calibration: Calibration, sections: Mapping[str, object], database: Database, version: str | None = None
) -> dict[str, str]:
    """File name -> text. sections: the table of the calibration's file; version: of the software, ours by default."""
    table, possible = measurements(), TroubleCodes(database).possible()
    version = version or importlib.metadata.version("loaderhil")
    identity = {
        MACHINE: machine_name(calibration.name),
        SOFTWARE_VERSION: version.encode(),
        CALIBRATION_NAME: calibration.name.encode(),
        CALIBRATION_CHECKSUM: struct.pack(">I", zlib.crc32(image_of(sections))),
    }
    floats = sum(row.type == FLOAT for row in table)
    sizes = {
        "MEASUREMENTS": len(table),
        "MEASURED_FLOATS": floats,
        "MEASURED_BYTES": sum(row.size for row in table),
        "MEASURED_IDENTIFIER": MEASURED_BASE,
        "IDENTITIES": len(identity),
        "POSSIBLE_CODES": len(possible),
    }
    header = "\n".join(
        [
            _NOTE + '#ifndef SERVICE_TABLES_H\n#define SERVICE_TABLES_H\n\n#include "ecu_tables.h"\n',
            "".join(numbered(name, size) for name, size in sizes.items()),
            _TYPES,
            "extern const Measured measured_rows[MEASUREMENTS];",
            "extern const Identity identities[IDENTITIES];",
            "extern const PossibleCode possible_codes[POSSIBLE_CODES];\n",
            "#endif\n",
        ]
    )
    source = "\n".join(
        [
            _NOTE + '#include "service_tables.h"\n',
            rows("Measured", "measured_rows", [_measured(row) for row in table], "MEASUREMENTS"),
            _identities(identity),
            rows("PossibleCode", "possible_codes", [f"{{{spn}U, {int(mode)}U}}" for spn, mode in possible], "POSSIBLE_CODES"),
        ]
    )  # fmt: skip
    return {"services/service_tables.h": header, "services/service_tables.c": source}


def _measured(row: Measurement) -> str:
    is_input = row.source == "input"
    place = constant("INPUT" if is_input else "VALUE", row.key)
    flags = ", ".join("true" if flag else "false" for flag in (is_input, row.type == FLOAT))
    return f"{{{place}, {flags}}} /* {row.name} */"


def _identities(identity: Mapping[int, bytes]) -> str:
    """The texts, and the table that names them."""
    texts, found = [], []
    for identifier, content in identity.items():
        name = f"identity_{identifier:x}"
        texts.append(f"static const uint8_t {name}[{len(content)}] = {byte_list(content)};")
        found.append(f"{{{identifier:#x}U, {len(content)}U, {name}}}")
    return "\n".join([*texts, "", rows("Identity", "identities", found, "IDENTITIES")])


def byte_list(content: Sequence[int]) -> str:
    """Bytes as an initialiser."""
    return "{" + ", ".join(f"{byte:#04x}U" for byte in content) + "}"
