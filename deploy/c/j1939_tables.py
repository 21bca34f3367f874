"""Tables in C of the network management of J1939: the ECU's address, the groups that it sends, and the texts that say who it is."""

from typing import Final

from dbc.database import Database
from deploy.c.tables import byte_list, numbered, rows
from ecu.j1939.claim import contention_ns
from ecu.j1939.service import (
    COMPONENT,
    COMPONENT_TAIL,
    SOFTWARE,
    address_of,
    component_head,
    sent_groups,
    software_text,
)

_NOTE: Final = (
    "/* Written by `loaderhil export-c` from the DBC and the calibration; edit those, not this file. */\n"
)


def j1939_files(calibration: str, database: Database, version: str) -> dict[str, str]:
    """File name -> text. calibration: its name; version: of the software."""
    groups = sorted(sent_groups(database))
    texts = {
        "SOFTWARE_BYTES": ("j1939_software", software_text(version)),
        "HEAD_BYTES": ("j1939_component_head", component_head(calibration)),
        "TAIL_BYTES": ("j1939_component_tail", COMPONENT_TAIL),
    }
    address = address_of(database)
    header = "\n".join(
        [
            _NOTE + "#ifndef J1939_TABLES_H\n#define J1939_TABLES_H\n\n#include <stdint.h>\n",
            numbered("J1939_ADDRESS", address)
            + f"#define J1939_CONTENTION_NS {contention_ns(address)}LL\n"
            + numbered("J1939_SOFTWARE", SOFTWARE)
            + numbered("J1939_COMPONENT", COMPONENT)
            + numbered("J1939_SENT_GROUPS", len(groups))
            + "".join(numbered(f"J1939_{size}", len(text)) for size, (_, text) in texts.items()),
            "extern const uint32_t j1939_sent_groups[J1939_SENT_GROUPS];",
            *(f"extern const uint8_t {name}[J1939_{size}];" for size, (name, _) in texts.items()),
            "\n#endif\n",
        ]
    )
    source = "\n".join(
        [
            _NOTE + '#include "j1939_tables.h"\n',
            rows("uint32_t", "j1939_sent_groups", [f"{group:#x}U" for group in groups], "J1939_SENT_GROUPS"),
            *(f"const uint8_t {name}[J1939_{size}] = {byte_list(text)};\n" for size, (name, text) in texts.items()),
        ]
    )  # fmt: skip
    return {"services/j1939_tables.h": header, "services/j1939_tables.c": source}
