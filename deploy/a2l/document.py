"""Writes the A2L file of a calibration from the two tables that the ECU itself reads: measurements and numbers.

ASAP2 1.61. A tool compares the file's EPK with the text in the ECU; both come from the same tables.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from bus.frame import EXTENDED
from ecu.measure import parameters
from ecu.measure.channel import Channel
from ecu.measure.measurements import FLOAT, Measurement, measurements
from ecu.measure.parameters import SIZE, CalibrationNumber, calibration_numbers
from ecu.quantity import Quantity
from ecu.xcp.memory import EPK_ADDRESS, epk
from ecu.xcp.packets import MAX_CTO, MAX_DTO, Command
from ecu.xcp.service import a2l_name

LARGEST: Final = 3.4e38  # of a float32, which has to be named where a signal knows no bounds
SECTION_WORDS: Final[Mapping[str, str]] = {
    "limits": "How the limits answer to the margin",
    "warnings": "Thresholds of the warnings",
    "alarms": "How long a condition has to hold or to be gone",
    "inputs": "When an input is stale or implausible",
}
"""Long names of sections; the others are parts of the machine and of the estimators."""
READ_ONLY: Final = "READ_ONLY"
_AML: Final = """\
    block "IF_DATA" taggedunion if_data {
      "XCP" struct {
        taggedstruct {
          block "PROTOCOL_LAYER" struct {
            uint; uint; uint; uint; uint; uint; uint; uint; uchar; uint;
            enum { "BYTE_ORDER_MSB_LAST" = 0, "BYTE_ORDER_MSB_FIRST" = 1 };
            enum { "ADDRESS_GRANULARITY_BYTE" = 1, "ADDRESS_GRANULARITY_WORD" = 2, "ADDRESS_GRANULARITY_DWORD" = 4 };
            taggedstruct { ("OPTIONAL_CMD" enum {
%s
            })*; };
          };
          block "DAQ" struct {
            enum { "STATIC" = 0, "DYNAMIC" = 1 }; uint; uint; uchar;
            enum { "OPTIMISATION_TYPE_DEFAULT" = 0 };
            enum { "ADDRESS_EXTENSION_FREE" = 0, "ADDRESS_EXTENSION_ODT" = 1, "ADDRESS_EXTENSION_DAQ" = 3 };
            enum { "IDENTIFICATION_FIELD_TYPE_ABSOLUTE" = 0 };
            enum { "GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE" = 1 };
            uchar;
            enum { "NO_OVERLOAD_INDICATION" = 0 };
            taggedstruct {
              "PRESCALER_SUPPORTED";
              block "TIMESTAMP_SUPPORTED" struct {
                uint; enum { "SIZE_DWORD" = 4 }; enum { "UNIT_1US" = 3 };
              };
              (block "EVENT" struct {
                char[101]; char[9]; uint; enum { "DAQ" = 1 }; uchar; uchar; uchar; uchar;
                taggedstruct { "CONSISTENCY" enum { "EVENT" = 1 }; };
              })*;
            };
          };
          block "XCP_ON_CAN" struct {
            uint;
            taggedstruct { "CAN_ID_MASTER" ulong; "CAN_ID_SLAVE" ulong; };
          };
        };
      };
      "XCP_SEGMENT" struct { uchar; uchar; uchar; };
    };
"""
_EVERY_SLAVE: Final = {Command.CONNECT, Command.DISCONNECT, Command.GET_STATUS, Command.SYNCH}
_OPTIONAL: Final = tuple(command for command in Command if command not in _EVERY_SLAVE)


def write_a2l(calibration: str, channel: Channel) -> str:
    """The A2L file for a calibration of this name."""
    name = a2l_name(calibration)
    lines = [
        "ASAP2_VERSION 1 61",
        *_block(
            f'PROJECT {name} "loaderhil, estimator ECU, calibration {calibration}"',
            _block(
                'MODULE estimator_ecu "Estimator ECU of an articulated wheel loader"',
                _module(channel),
            ),
        ),
    ]
    return "\n".join(lines) + "\n"


def _module(channel: Channel) -> Iterator[str]:
    yield from _block("A2ML", _AML.replace("%s", _commands_of_aml()).splitlines())
    yield from _block(
        'MOD_COMMON "All values are SI or in the unit of their name"',
        ["BYTE_ORDER MSB_LAST", "ALIGNMENT_FLOAT32_IEEE 1"],
    )
    yield from _block('MOD_PAR ""', _module_parameters())
    yield from _block("IF_DATA XCP", _xcp(channel))
    yield from _block("RECORD_LAYOUT float32", ["FNC_VALUES 1 FLOAT32_IEEE ROW_DIR DIRECT"])
    rows, numbers = measurements(), calibration_numbers()
    tables = _tables(rows)
    units = dict.fromkeys(
        [*(row.unit for row in rows if not row.choices), *(n.quantity.unit for n in numbers)]
    )
    for unit in units:
        yield from _block(f'COMPU_METHOD {_method(unit)} "" IDENTICAL "%.6" "{unit}"', [])
    for choices, name in tables.items():
        yield from _block(f'COMPU_METHOD {name} "" TAB_VERB "%3.0" ""', [f"COMPU_TAB_REF {name}.table"])
        values = [f"{number} {_quoted(text)}" for number, text in choices]
        yield from _block(
            f'COMPU_VTAB {name}.table "" TAB_VERB {len(values)}', [*values, 'DEFAULT_VALUE "?"']
        )
    for row in rows:
        yield from _measurement(row, tables[_choices(row)] if row.choices else _method(row.unit))
    for number in numbers:
        yield from _characteristic(number, adjustable=number.adjustable)
    yield from _groups(rows, numbers)


def _commands_of_aml() -> str:
    return ",\n".join(f'              "{command.name}" = {command.value:#x}' for command in _OPTIONAL)


def _module_parameters() -> Iterator[str]:
    size = SIZE * len(calibration_numbers())
    yield f'EPK "{epk().decode()}"'
    yield f"ADDR_EPK {EPK_ADDRESS:#x}"
    yield from _block(
        f'MEMORY_SEGMENT calibration "" DATA RAM INTERN {parameters.BASE:#x} {size:#x} -1 -1 -1 -1 -1',
        _block("IF_DATA XCP_SEGMENT", ["0x00 0x02 0x00"]),
    )


def _xcp(channel: Channel) -> Iterator[str]:
    """What a tool has to know of the protocol: times [ms] of its patience, sizes, commands, the event, the identifiers."""
    yield from _block(
        "PROTOCOL_LAYER",
        [
            f"0x0101 2000 2000 2000 2000 2000 2000 2000 {MAX_CTO} {MAX_DTO} BYTE_ORDER_MSB_LAST ADDRESS_GRANULARITY_BYTE",
            *(f"OPTIONAL_CMD {command.name}" for command in _OPTIONAL),
        ],
    )
    event = _block('EVENT "cycle" "cycle" 0 DAQ 0xFF 10 6 0', ["CONSISTENCY EVENT"])
    yield from _block(
        "DAQ",
        [
            "DYNAMIC 0 1 0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE IDENTIFICATION_FIELD_TYPE_ABSOLUTE",
            "GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE 7 NO_OVERLOAD_INDICATION",
            "PRESCALER_SUPPORTED",
            *_block("TIMESTAMP_SUPPORTED", ["1 SIZE_DWORD UNIT_1US"]),
            *event,
        ],
    )
    # as A2L writes them, bit 31 marks an identifier of 29 bits, which is Linux' mark as well
    assert EXTENDED == 1 << 31
    yield from _block(
        "XCP_ON_CAN", ["0x0101", f"CAN_ID_MASTER {channel.receive:#x}", f"CAN_ID_SLAVE {channel.send:#x}"]
    )


def _measurement(row: Measurement, method: str) -> list[str]:
    low, high = (f"-{LARGEST}", f"{LARGEST}") if row.type == FLOAT else ("0", "255")
    return _block(
        f"MEASUREMENT {row.name} {_quoted(row.comment)} {row.type} {method} 0 0 {low} {high}",
        [f"ECU_ADDRESS {row.address:#x}"],
    )


def _characteristic(number: CalibrationNumber, *, adjustable: bool) -> list[str]:
    q: Quantity = number.quantity
    return _block(
        f'CHARACTERISTIC {number.name} "[{q.unit}]" VALUE {number.address:#x} float32 0 {_method(q.unit)} {q.low!r} {q.high!r}',
        [] if adjustable else [READ_ONLY],
    )


def _groups(rows: Iterable[Measurement], numbers: Iterable[CalibrationNumber]) -> Iterator[str]:
    """One group for each first part of the names; tools show them as folders."""
    measured: dict[str, list[str]] = {}
    for row in rows:
        first, dot, _ = row.name.partition(".")
        measured.setdefault(first if dot else "cycle", []).append(row.name)
    for name, members in measured.items():
        yield from _block(f'GROUP measured_{name} "" ROOT', _block("REF_MEASUREMENT", [" ".join(members)]))
    sections: dict[str, list[str]] = {}
    for number in numbers:
        sections.setdefault(number.section, []).append(number.name)
    for section, members in sections.items():
        words = SECTION_WORDS.get(section, "")
        yield from _block(
            f'GROUP {section} "{words}" ROOT', _block("REF_CHARACTERISTIC", [" ".join(members)])
        )


_Choices = tuple[tuple[int, str], ...]


def _choices(row: Measurement) -> _Choices:
    return tuple(sorted(row.choices.items()))


def _tables(rows: Iterable[Measurement]) -> dict[_Choices, str]:
    """Names of value tables by their words: each has the name of the first measurement with these words."""
    names: dict[_Choices, str] = {}
    for row in rows:
        if row.choices:
            names.setdefault(_choices(row), f"choices.{row.name}")
    return names


def _method(unit: str) -> str:
    """The name of a unit's conversion: letters, digits and underscores."""
    names = {"/": "_per_", ".": "_", " ": "_"}
    return "unit_" + "".join(
        names.get(character, character) for character in unit if character.isalnum() or character in names
    )


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', "'") + '"'


def _block(head: str, content: Iterable[str]) -> list[str]:
    """/begin HEAD, the indented content, /end with the keyword."""
    return [f"/begin {head}", *(f"  {line}" for line in content), f"/end {head.split(' ')[0]}"]
