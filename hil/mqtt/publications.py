"""Decides what the MQTT bridge publishes: the newest frame of every message, and findings when they change.

    PREFIX/bus/BUS/MESSAGE[/ID]   retained; the object of `loaderhil monitor --json`. ID only where a J1939
                                  message comes from another address than the DBC's
    PREFIX/findings               one object per event: time_s, bus, message, finding
    PREFIX/bridge/statistics      retained: counters
    PREFIX/bridge/status          retained: online, or offline, which is also the last will
    PREFIX/command, PREFIX/reply  commands for fault injection, and their answers

Pure: rows of a board go in, publications come out. A state that a slow broker has not taken is replaced by a newer one.
"""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hil.monitor.board import Pace, Row
from hil.monitor.decoded import decoded

_REPORTED = frozenset({Pace.STALE, Pace.MISSING, Pace.SLOW, Pace.FAST})
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
        """Topic: whether the bridge is connected."""
        return f"{self.prefix}/bridge/status"

    @property
    def statistics(self) -> str:
        """Topic: counters of the bridge."""
        return f"{self.prefix}/bridge/statistics"

    @property
    def findings(self) -> str:
        """Topic: findings, one per change."""
        return f"{self.prefix}/findings"

    @property
    def command(self) -> str:
        """Topic on which commands are accepted."""
        return f"{self.prefix}/command"

    @property
    def reply(self) -> str:
        """Topic of the answers to commands."""
        return f"{self.prefix}/reply"

    def message(self, row: Row) -> str:
        """The topic of a message; characters with a meaning in MQTT are replaced in the name of the bus."""
        own = f"{self.prefix}/bus/{_SEPARATORS.sub('_', row.bus)}/{row.name}"
        return f"{own}/{row.variant}" if row.variant else own


@dataclass(slots=True)
class _Published:
    """The state of a row that was published last."""

    count: int = 0
    findings: int = 0
    pace: Pace = Pace.NONE


class Publisher:
    """Remembers the published state and gives the changes. superseded: frames that a newer one replaced before they were published."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._published: dict[Key, _Published] = {}
        self._renewed: set[Key] = set()
        self.superseded = 0

    def renew(self) -> None:
        """Publish the state of every message again: a broker that was restarted has forgotten it."""
        self._renewed = set(self._published)

    def due(self, rows: Sequence[Row], wall_ns: int) -> Iterator[Publication]:
        """The changes in the rows, one by one; each one that is taken counts as published. wall_ns: now, since 1970."""
        for row in rows:
            key = row.bus, row.identifier
            published = self._published.setdefault(key, _Published())
            yield from self._events(row, published, wall_ns)
            # error frames and missing messages have no state to publish, only events
            if row.shown is None or row.age_ns is None:
                continue
            if row.count != published.count or key in self._renewed:
                # frames between two publications that no subscriber sees
                self.superseded += max(0, row.count - published.count - 1)
                published.count = row.count
                self._renewed.discard(key)
                yield Publication(self._topics.message(row), _state(row, wall_ns - row.age_ns), retain=True)

    def _events(self, row: Row, published: _Published, wall_ns: int) -> Iterator[Publication]:
        """Findings of a row since it was published last."""
        found = []
        if row.findings != published.findings:
            found.append(row.note)
            published.findings = row.findings
        # LATE is passed over: one late frame happens on a busy host, and the next state follows soon
        if row.pace is not published.pace and row.pace is not Pace.LATE:
            if row.pace in _REPORTED:
                found.append(str(row.pace))
            elif published.pace in _REPORTED:
                found.append(_IN_TIME)
            published.pace = row.pace
        for finding in found:
            event = {"time_s": wall_ns // 1000 / 1e6, "bus": row.bus, "message": row.name, "finding": finding}
            yield Publication(self._topics.findings, json.dumps(event))


def _state(row: Row, came_ns: int) -> str:
    """The newest frame of a message in the form of `loaderhil monitor --json`, with its period."""
    assert row.shown is not None
    findings = [row.note] if row.note else []
    period = "null" if row.period_ns is None else f"{row.period_ns / 1e6:.3f}"
    return (
        f'{{"time_s": {came_ns // 1000 / 1e6}, "bus": {json.dumps(row.bus)}, "id": "{row.identifier}", '
        f'"period_ms": {period}, {decoded(row.shown, row.readings, findings)}}}'
    )
