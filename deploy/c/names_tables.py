"""Names for the log of the Linux program: what `loaderhil ecu` calls messages, signals, states, checks and failure modes."""

import json
from collections.abc import Sequence
from typing import Final

from dbc.database import Database
from deploy.c.rules_tables import CHECKS, EVENTS
from deploy.c.tables import inputs_of, rows, sent_order
from ecu.calibration import Calibration
from ecu.codes import Mode
from ecu.inputs import GROUP_OF, Group
from ecu.outputs import messages
from ecu.states import State

_NOTE: Final = "/* Written by `loaderhil export-c`: the names that the Python ECU's log has. */\n"
_KNOWN: Final = """
/* Every message of the DBC: none of its identifiers is free for a tool. */
#define KNOWN_IDENTIFIERS {count}U

typedef struct {{
    uint32_t id;
    const char *name;
}} KnownIdentifier;

extern const KnownIdentifier known_identifiers[KNOWN_IDENTIFIERS];
"""


def name_files(calibration: Calibration, database: Database) -> dict[str, str]:
    """File name -> text."""
    signals = [
        f"message={each.source.message!r}, signal={each.source.fields[each.at].row.signal!r}"
        for each in inputs_of(calibration)
    ]
    modes = {int(mode): repr(mode.name) for mode in Mode}
    tables: dict[str, Sequence[str]] = {
        "messages": list(GROUP_OF),
        "sent": [codec.name for codec in sent_order(messages(), database)],
        "inputs": signals,
        "groups": [group.name.lower() for group in Group],
        "states": [repr(state) for state in State],
        "events": [repr(event) for event in EVENTS],
        "checks": [repr(check) for check in CHECKS],
        "modes": [modes.get(k, "''") for k in range(max(modes) + 1)],
    }
    sizes = {name: f"names_of_{name}[{len(words)}]" for name, words in tables.items()}
    header = "".join(f"extern const char *const {size};\n" for size in sizes.values()) + _KNOWN.format(
        count=len(database.by_id)
    )
    source = "\n".join(
        f"const char *const {sizes[name]} = {{\n"
        + "".join(f"    {json.dumps(word)},\n" for word in words)
        + "};\n"
        for name, words in tables.items()
    )
    known = [f"{{{can_id:#x}U, {json.dumps(codec.name)}}}" for can_id, codec in database.by_id.items()]
    source += "\n" + rows("KnownIdentifier", "known_identifiers", known, "KNOWN_IDENTIFIERS")
    return {
        "linux/ecu_names.h": f"{_NOTE}#ifndef ECU_NAMES_H\n#define ECU_NAMES_H\n\n#include <stdint.h>\n\n{header}\n#endif\n",
        "linux/ecu_names.c": f'{_NOTE}#include "ecu_names.h"\n\n{source}',
    }
