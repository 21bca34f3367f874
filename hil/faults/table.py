"""Reads the `[[fault]]` tables of a scenario, of a file of faults and of live commands, checked against the DBC.

The plant's reader of scenarios leaves these tables to the bench.
"""

import difflib
import fnmatch
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from configuration import CheckedTable, reader_of, tables_of
from dbc.database import Database, MessageCodec
from hil.faults import corruption, lateness, loss, processes, signals, traffic
from hil.faults.passage import NODES, Fault, Selection, Settings

SECOND = 1_000_000_000
LONGEST_S = 86_400.0

Reader = Callable[[CheckedTable, Selection], Settings]


def _alone(read: Callable[[CheckedTable], Settings]) -> Reader:
    """A reader that does not need to know the selected messages."""
    return lambda table, _: read(table)


KINDS: Mapping[str, Reader] = {
    "drop": _alone(loss.read_drop),
    "repeat": _alone(loss.read_repeat),
    "delay": _alone(lateness.read_delay),
    "jitter": _alone(lateness.read_jitter),
    "reorder": _alone(lateness.read_reorder),
    "corrupt": _alone(corruption.read_corrupt),
    "freeze": signals.read_freeze,
    "offset": signals.read_offset,
    "spike": signals.read_spike,
    "swap": signals.read_swap,
    "babble": traffic.read_babble,
    "bus_off": _alone(traffic.read_bus_off),
    "kill": _alone(processes.read_kill),
}
WITHOUT_MESSAGES = ("bus_off", "kill")
"""Kinds that affect a node or a process, not messages."""


def faults_of(file: Path, database: Database, *, alone: bool = False) -> tuple[Fault, ...]:
    """The faults of a TOML file in its order; ConfigurationError names file, key, value, unit and range.

    alone: the file holds faults and nothing else; otherwise it is a scenario and they may be missing.
    """
    return tables_of(file, "fault", lambda table: read_fault(table, database), alone=alone, plural="faults")


def read_fault(table: CheckedTable, database: Database) -> Fault:
    """The fault of one [[fault]] table. ConfigurationError if it is not valid."""
    read, kind = reader_of(table, KINDS, "fault"), table.text("kind")
    at_s = table.number("at_s", unit="s", low=0.0, high=LONGEST_S, default=0.0)
    for_s = table.number("for_s", unit="s", low=1e-3, high=LONGEST_S) if "for_s" in table else None
    # these kinds have no key `message`: finish() then refuses it as unknown
    selection = Selection() if kind in WITHOUT_MESSAGES else _selection(table, database)
    settings = read(table, selection)
    table.finish()
    return Fault(
        kind=kind,
        label=_label(kind, table.values),
        selection=selection,
        at_ns=round(at_s * SECOND),
        for_ns=None if for_s is None else round(for_s * SECOND),
        settings=settings,
    )


def _label(kind: str, values: Mapping[str, object]) -> str:
    """Description of a fault: kind, message and parameters of its table, without its times."""
    kept = {key: value for key, value in values.items() if key not in ("kind", "at_s", "for_s")}
    message = [str(kept.pop("message"))] if "message" in kept else []
    return " ".join([kind, *message, *(f"{key}={_shown(value)}" for key, value in kept.items())])


def _shown(value: object) -> str:
    if isinstance(value, list):
        return ",".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _selection(table: CheckedTable, database: Database) -> Selection:
    side = traffic.read_side(table, "from") if "from" in table else None
    pattern = table.text("message", default="*")
    if pattern == "*":
        return Selection(side=side)
    codecs = matching(pattern, database)
    if not codecs:
        raise table.error(
            "message", f"= {pattern!r} is no message of {database.source}{_hint(pattern, database)}"
        )
    # a message of the ECU cannot come from the plant: the fault would silently never act
    senders = {NODES[node] for codec in codecs for node in codec.senders if node in NODES}
    if side is not None and senders and side not in senders:
        raise table.error("from", f"= {side!r}, but {pattern} comes from {' and '.join(sorted(senders))}")
    return Selection(codecs=tuple(codecs), side=side)


def matching(pattern: str, database: Database) -> Sequence[MessageCodec]:
    """The messages of a name: the one so called, else those that begin with it, or those that match a pattern with *."""
    # an exact name first: "Limits" must not also mean a message "LimitsExtended"
    if pattern in database.by_name:
        return [database.by_name[pattern]]
    glob = pattern if set(pattern) & set("*?[") else f"{pattern}*"
    return [codec for name, codec in database.by_name.items() if fnmatch.fnmatchcase(name, glob)]


def _hint(pattern: str, database: Database) -> str:
    near = difflib.get_close_matches(pattern, database.by_name, n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; it has {', '.join(database.by_name)}"
