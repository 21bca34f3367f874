"""Tables in C of what the services on the bus offer: identity, measurements, trouble codes that there can be, the calibration's numbers."""

import importlib.metadata
import struct
import zlib
from collections.abc import Mapping
from typing import Final

from dbc.database import Database
from deploy.c.j1939_tables import j1939_files
from deploy.c.tables import byte_list, constant, numbered, real, rows
from deploy.c.translation.names import local_name
from ecu import reasons
from ecu.calibration import ORDERED, WITH_AREAS, Calibration, fields_of
from ecu.codes import TroubleCodes
from ecu.consistency import FRICTION, PULL
from ecu.measure.measurements import BASE as MEASURED_ADDRESS
from ecu.measure.measurements import FLOAT, Measurement, measurements
from ecu.measure.parameters import BASE as CALIBRATION_ADDRESS
from ecu.measure.parameters import CalibrationNumber, calibration_numbers, image_of
from ecu.uds.identity import (
    CALIBRATION_CHECKSUM,
    CALIBRATION_NAME,
    MACHINE,
    MEASURED_BASE,
    SOFTWARE_VERSION,
    machine_name,
)
from ecu.xcp.memory import EPK_ADDRESS, epk
from ecu.xcp.service import identifications

_NOTE: Final = "/* Written by `loaderhil export-c` from the ECU's tables and the calibration; edit those, not this file. */\n"
AREA_FIELDS: Final = ("bore", "rod", "count")
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

typedef struct {
    real_t reference; /* of the calibration's file, in the unit of its key, as are the limits of its range */
    real_t low;
    real_t high;
    real_t factor; /* SI value per value in that unit */
    real_t *target; /* where its SI value goes; NULL: what it means is computed (calibrated.c) */
    bool is_adjustable; /* while the ECU runs */
} CalibrationNumber;

typedef struct { /* of two numbers the first has to be below the second */
    uint16_t low;
    uint16_t high;
} OrderedNumbers;
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
    texts, pairs = identifications(calibration.name), _ordered()
    sizes |= {
        "XCP_TEXTS": len(texts),
        "EPK_BYTES": len(epk()),
        "EPK_ADDRESS": EPK_ADDRESS,
        "MEASURED_BASE": MEASURED_ADDRESS,
        "CALIBRATION_BASE": CALIBRATION_ADDRESS,
        "CALIBRATION_NUMBERS": len(calibration_numbers()),
        "ORDERED_NUMBERS": len(pairs),
    }
    header = "\n".join(
        [
            _NOTE + '#ifndef SERVICE_TABLES_H\n#define SERVICE_TABLES_H\n\n#include "ecu_tables.h"\n',
            "".join(numbered(name, size) for name, size in sizes.items()),
            _places(),
            f"#define PULL_SHARE {real(PULL)}\n#define FRICTION_SHARE {real(FRICTION)}\n",
            _TYPES,
            "extern const Measured measured_rows[MEASUREMENTS];",
            "extern const Identity identities[IDENTITIES];",
            "extern const PossibleCode possible_codes[POSSIBLE_CODES];",
            "extern const Identity xcp_texts[XCP_TEXTS];",
            "extern const uint8_t epk_text[EPK_BYTES];",
            "extern const CalibrationNumber calibration_rows[CALIBRATION_NUMBERS];",
            "extern const OrderedNumbers ordered_numbers[ORDERED_NUMBERS];",
            "/* the delay of every alarm: 0 none, 1 short, 2 usual */",
            "extern const uint8_t alarm_delays[ALARMS];\n",
            "#endif\n",
        ]
    )
    source = "\n".join(
        [
            _NOTE + '#include "service_tables.h"\n\n#include <stddef.h>\n\n#include "calibration.h"\n',
            rows("Measured", "measured_rows", [_measured(row) for row in table], "MEASUREMENTS"),
            _identities("identities", identity, "IDENTITIES"),
            _identities("xcp_texts", texts, "XCP_TEXTS"),
            f"const uint8_t epk_text[EPK_BYTES] = {byte_list(epk())};\n",
            rows("CalibrationNumber", "calibration_rows", _numbers(sections), "CALIBRATION_NUMBERS"),
            rows("OrderedNumbers", "ordered_numbers", pairs, "ORDERED_NUMBERS"),
            rows("uint8_t", "alarm_delays", _delays(), "ALARMS"),
            rows("PossibleCode", "possible_codes", [f"{{{spn}U, {int(mode)}U}}" for spn, mode in possible], "POSSIBLE_CODES"),
        ]
    )  # fmt: skip
    tables = {"services/service_tables.h": header, "services/service_tables.c": source}
    return tables | j1939_files(calibration.name, database, version)


def _measured(row: Measurement) -> str:
    is_input = row.source == "input"
    place = constant("INPUT" if is_input else "VALUE", row.key)
    flags = ", ".join("true" if flag else "false" for flag in (is_input, row.type == FLOAT))
    return f"{{{place}, {flags}}} /* {row.name} */"


def _identities(table: str, contents: Mapping[int, bytes], size: str) -> str:
    """The texts, and the table that names them."""
    texts, found = [], []
    for identifier, content in contents.items():
        name = f"{table}_{identifier:x}"
        texts.append(f"static const uint8_t {name}[{len(content)}] = {byte_list(content)};")
        found.append(f"{{{identifier:#x}U, {len(content)}U, {name}}}")
    return "\n".join([*texts, "", rows("Identity", table, found, size)])


# -- the calibration's numbers


def _numbers(sections: Mapping[str, object]) -> list[str]:
    found = []
    for number in calibration_numbers():
        quantity, table = number.quantity, sections[number.section]
        assert isinstance(table, Mapping)
        values = (float(table[number.key]), quantity.low, quantity.high, quantity.si(1.0))
        adjustable = "true" if number.adjustable else "false"
        found.append(
            f"{{{', '.join(map(real, values))}, {_target(number)}, {adjustable}}} /* {number.name} */"
        )
    return found


def _field(number: CalibrationNumber) -> str | None:
    """The name of a number in its section; None in the sections of the detection, which are fixed while the ECU runs."""
    if number.section.startswith(("detection", "sensor_")):
        return None
    fields = fields_of(number.section)
    return next(name for name, quantity in fields.items() if quantity is number.quantity)


def _target(number: CalibrationNumber) -> str:
    field, section = _field(number), number.section
    if field is None or section in ("inputs", "alarms") or (section in WITH_AREAS and field in AREA_FIELDS):
        return "NULL"
    if section == "warnings":
        return f"&{constant('WARNING', field)}"
    if section == "limits":
        return f"&calibration_limits.{local_name(field)}"
    return f"&calibration_parameters.{local_name(section)}.{local_name(field)}"


def _place(section: str, field: str) -> int:
    return next(k for k, n in enumerate(calibration_numbers()) if n.section == section and _field(n) == field)


def _places() -> str:
    """The places of numbers that a rule or a computed value needs, by name."""
    wanted = [("front", "x"), ("rear", "x"), *(("alarms", name) for name in fields_of("alarms"))]
    wanted += [(section, field) for section in WITH_AREAS for field in AREA_FIELDS]
    return "".join(numbered(constant("NUMBER", f"{s} {f}"), _place(s, f)) for s, f in wanted)


def _ordered() -> list[str]:
    """Pairs of numbers of one unit, so that what is below in the unit is below in SI."""
    pairs = [*ORDERED, *((section, "rod", "bore") for section in WITH_AREAS)]
    return [
        f"{{{_place(section, low)}U, {_place(section, high)}U}} /* {section}.{low} */"
        for section, low, high in pairs
    ]


def _delays() -> list[str]:
    names = (*reasons.REASONS, *(state.name for state in reasons.STATES))
    kinds = list(reasons.Delay)
    delays = {name: reason.delay for name, reason in reasons.REASONS.items()}
    return [f"{kinds.index(delays.get(name, reasons.Delay.SHORT))}U /* {name} */" for name in names]
