"""What is told to a broker: the newest of every message, and what changed for better or worse.

    PREFIX/bus/BUS/MESSAGE[/ID]   retained; the object of `loaderhil monitor --json`. ID only where a J1939
                                  message comes from another address than the DBC's
    PREFIX/findings               one object per event: time_s, bus, message, finding
    PREFIX/bridge/statistics      retained: counters
    PREFIX/bridge/status          retained: online, or offline, which is also the last will
    PREFIX/command, PREFIX/reply  commands for fault injection, and their answers

Pure: rows of a board go in, publications come out; what a slow broker has not taken is replaced by what is newer.
"""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hil.monitor.board import Pace, Row
from hil.monitor.decoded import decoded

_TOLD = frozenset({Pace.STALE, Pace.MISSING, Pace.SLOW, Pace.FAST})
_IN_TIME = "in time again"
_SEPARATORS = re.compile(r"[/+#\0]")
Key = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Publication:
    """One message for the broker."""

    topic: str
    payload: str
    retain: bool = False


@dataclass(frozen=True, slots=True)
class Topics:
    """The names under one prefix."""

    prefix: str

    @property
    def status(self) -> str:
        """Whether the bridge is there."""
        return f"{self.prefix}/bridge/status"

    @property
    def statistics(self) -> str:
        """Its counters."""
        return f"{self.prefix}/bridge/statistics"

    @property
    def findings(self) -> str:
        """What changed for better or worse."""
        return f"{self.prefix}/findings"

    @property
    def command(self) -> str:
        """Where commands come in."""
        return f"{self.prefix}/command"

    @property
    def reply(self) -> str:
        """Where their answers go."""
        return f"{self.prefix}/reply"

    def message(self, row: Row) -> str:
        """The topic of a message; what MQTT gives a meaning is replaced in the bus' name."""
        own = f"{self.prefix}/bus/{_SEPARATORS.sub('_', row.bus)}/{row.name}"
        return f"{own}/{row.variant}" if row.variant else own


@dataclass(slots=True)
class _Told:
    """What the broker knows of a row."""

    count: int = 0
    findings: int = 0
    pace: Pace = Pace.NONE


class Publisher:
    """Remembers what was told, and gives what is new; superseded: frames that were never told, being replaced."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._told: dict[Key, _Told] = {}
        self._renewed: set[Key] = set()
        self.superseded = 0

    def renew(self) -> None:
        """A broker that may have forgotten everything is there: tell each message's state again."""
        self._renewed = set(self._told)

    def due(self, rows: Sequence[Row], wall_ns: int) -> Iterator[Publication]:
        """What is new in the rows, one by one; what has been taken counts as told. wall_ns: now, since 1970."""
        for row in rows:
            key = row.bus, row.identifier
            told = self._told.setdefault(key, _Told())
            yield from self._events(row, told, wall_ns)
            if row.shown is None or row.age_ns is None:
                continue
            if row.count != told.count or key in self._renewed:
                self.superseded += max(0, row.count - told.count - 1)
                told.count = row.count
                self._renewed.discard(key)
                yield Publication(self._topics.message(row), _state(row, wall_ns - row.age_ns), retain=True)

    def _events(self, row: Row, told: _Told, wall_ns: int) -> Iterator[Publication]:
        """Findings of a row since it was told last."""
        found = []
        if row.findings != told.findings:
            found.append(row.note)
            told.findings = row.findings
        if row.pace is not told.pace and row.pace is not Pace.LATE:  # late alone may be nothing
            if row.pace in _TOLD:
                found.append(str(row.pace))
            elif told.pace in _TOLD:
                found.append(_IN_TIME)
            told.pace = row.pace
        for finding in found:
            event = {"time_s": wall_ns // 1000 / 1e6, "bus": row.bus, "message": row.name, "finding": finding}
            yield Publication(self._topics.findings, json.dumps(event))


def _state(row: Row, came_ns: int) -> str:
    """The newest frame of a message as `loaderhil monitor --json` tells it, with its period."""
    assert row.shown is not None
    findings = [row.note] if row.note else []
    period = "null" if row.period_ns is None else f"{row.period_ns / 1e6:.3f}"
    return (
        f'{{"time_s": {came_ns // 1000 / 1e6}, "bus": {json.dumps(row.bus)}, "id": "{row.identifier}", '
        f'"period_ms": {period}, {decoded(row.shown, row.readings, findings)}}}'
    )
