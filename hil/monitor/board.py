"""The state behind the monitor's table and the MQTT bridge: per message the newest frame, its period and its age.

Pure: stamps come in with the frames, and the time with the question. A cyclic message is *late* from 1.5 periods
of silence on, *stale* from 3 on (the limits of `hil.timing.deadlines`), *missing* if it never came although its sender
sends; *slow* or *fast* if it keeps coming at a period that is off by more than half.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from bus import errors
from bus.frame import ERROR, Frame
from dbc.errors import DecodeError
from hil.monitor.candump import identifier
from hil.monitor.integrity import Integrity
from hil.monitor.messages import Field, Messages, Number, Shown
from hil.timing.deadlines import STALE_AFTER, TOLERANCE

# 32 gaps: enough to average the jitter of one frame, few enough to follow a change of rate within a second.
_STAMPS = 33
_PAUSE_NS = 3_000_000_000
"""Silence after which the period of a message without a cycle time is measured anew [ns]."""


class Pace(StrEnum):
    """How a message keeps its period; NONE: as expected, or it has no period."""

    NONE = ""
    FAST = "fast"
    SLOW = "slow"
    LATE = "late"
    STALE = "stale"
    MISSING = "missing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One message on one bus, as the table shows it."""

    bus: str
    name: str  # empty if no DBC knows the identifier
    identifier: str
    count: int  # frames so far
    period_ns: float | None  # mean of the latest gaps; None before the second frame
    cycle_ns: int  # of the DBC; 0 if it gives none
    age_ns: int | None  # of the newest frame; None if none ever came
    pace: Pace
    readings: tuple[tuple[Field, Number], ...] = ()  # each shown signal with its value
    note: str = ""  # the latest finding, an error, or the raw data
    findings: int = 0  # frames with a finding
    shown: Shown | None = None
    variant: str = ""  # the identifier where it differs from the DBC's (J1939 source address), else ''
    deviations: Mapping[str, str] = field(default_factory=dict)  # standard deviation by signal, as text


class _Stream:
    """The state kept of one identifier on one bus."""

    def __init__(self, bus: str, can_id: int, shown: Shown | None) -> None:
        self.bus, self.can_id, self.shown = bus, can_id, shown
        self.count = self.findings = 0
        self.latest_finding = ""
        self.stamps: deque[int] = deque(maxlen=_STAMPS)
        self.data = b""
        self.readings: dict[str, tuple[Field, Number]] = {}
        own = shown is None or shown.codec.can_id == can_id
        self.variant = "" if own else identifier(can_id)
        self.cycle_ns = shown.codec.cycle_ns if shown is not None else 0
        self._pause_ns = round(STALE_AFTER * self.cycle_ns) or _PAUSE_NS

    def take(self, frame: Frame) -> None:
        # a pause is no period: the mean over it would be wrong for the next 32 frames
        if self.stamps and frame.at_ns - self.stamps[-1] > self._pause_ns:
            self.stamps.clear()
        self.stamps.append(frame.at_ns)
        self.data = frame.data
        self.count += 1
        if self.shown is not None and self.shown.codec.is_multiplexed:
            self._decode()  # each frame carries other signals: the latest of each is kept

    def _decode(self) -> None:
        assert self.shown is not None
        try:
            self.readings |= {field.name: (field, value) for field, value in self.shown.readings(self.data)}
        except DecodeError as error:
            self.latest_finding = str(error)

    def row(self, now_ns: int) -> Row:
        period_ns = None
        if len(self.stamps) > 1:
            period_ns = (self.stamps[-1] - self.stamps[0]) / (len(self.stamps) - 1)
        age_ns = max(0, now_ns - self.stamps[-1])
        # decoded only when the table is drawn: most frames are never shown
        name, note = "", self.data.hex(" ").upper()
        readings: tuple[tuple[Field, Number], ...] = ()
        if self.shown is not None:
            if not self.shown.codec.is_multiplexed:
                self._decode()
            name, note = self.shown.codec.name, self.latest_finding
            readings = tuple(self.readings.values())
        elif self.can_id & ERROR:
            name = "error frame"
            note = "; ".join(map(str, errors.findings(Frame(self.can_id, self.data))))
            self.findings = self.count
        return Row(
            bus=self.bus,
            name=name,
            identifier=identifier(self.can_id),
            count=self.count,
            period_ns=period_ns,
            cycle_ns=self.cycle_ns,
            age_ns=age_ns,
            pace=pace(self.cycle_ns, period_ns, age_ns),
            readings=readings,
            note=note,
            findings=self.findings,
            shown=self.shown,
            variant=self.variant,
        )


def pace(cycle_ns: int, period_ns: float | None, age_ns: int) -> Pace:
    """How a message that has come keeps its period."""
    if not cycle_ns:
        return Pace.NONE
    if age_ns > STALE_AFTER * cycle_ns:
        return Pace.STALE
    if age_ns > (1 + TOLERANCE) * cycle_ns:
        return Pace.LATE
    if period_ns is None:
        return Pace.NONE
    if period_ns > (1 + TOLERANCE) * cycle_ns:
        return Pace.SLOW
    return Pace.FAST if period_ns < (1 - TOLERANCE) * cycle_ns else Pace.NONE


def _with_deviations(rows: list[Row]) -> list[Row]:
    """The rows, each with the standard deviations that others carry for its signals; none that is stale or not available."""
    fresh = [(row.bus, *reading) for row in rows if row.pace is not Pace.STALE for reading in row.readings]
    sent = {(bus, of): f.text(v) for bus, f, v in fresh if (of := f.signal.uncertainty_of) and not f.label(v)}
    found = [
        {f.name: sent.get((row.bus, f"{row.name}.{f.name}"), "") for f, _ in row.readings} for row in rows
    ]
    return [replace(row, deviations=of) for row, of in zip(rows, found, strict=True)] if sent else rows


class Board:
    """Everything seen so far."""

    def __init__(self, messages: Messages) -> None:
        self._messages = messages
        self._integrity = Integrity()
        self._streams: dict[tuple[str, int], _Stream] = {}
        self._first_ns: int | None = None
        self.frames = 0

    def take(self, bus: str, frame: Frame) -> None:
        """Take a frame; its at_ns is on the same clock as the time given to `rows`."""
        self.frames += 1
        if self._first_ns is None:
            self._first_ns = frame.at_ns
        stream = self._streams.get((bus, frame.can_id))
        if stream is None:
            shown = self._messages.of(frame.can_id)
            if shown is None and not self._messages.selection.everything:
                return
            stream = self._streams[bus, frame.can_id] = _Stream(bus, frame.can_id, shown)
        stream.take(frame)
        if stream.shown is not None and (found := self._integrity.findings(bus, frame, stream.shown.codec)):
            stream.findings += 1
            stream.latest_finding = "; ".join(found)

    def since_ns(self, now_ns: int) -> int:
        """How long ago the first frame came; 0 before it."""
        return 0 if self._first_ns is None else max(0, now_ns - self._first_ns)

    def rows(self, now_ns: int) -> list[Row]:
        """Every message by bus and name, including missing ones; unknown identifiers last."""
        rows = _with_deviations([stream.row(now_ns) for stream in self._streams.values()])
        rows += self._missing(self.since_ns(now_ns))
        return sorted(rows, key=lambda row: (row.bus, not row.name, row.name, row.identifier))

    def _missing(self, watched_ns: int) -> Iterator[Row]:
        """Messages that never came although their sender sends others, and that are overdue since the first frame."""
        heard = {(stream.bus, stream.shown.codec) for stream in self._streams.values() if stream.shown}
        owed = {(bus, other.codec) for bus, codec in heard for other in self._messages.expected_beside(codec)}
        for bus, codec in owed - heard:
            if watched_ns <= STALE_AFTER * codec.cycle_ns:
                continue
            yield Row(
                bus=bus,
                name=codec.name,
                identifier=identifier(codec.can_id),
                count=0,
                period_ns=None,
                cycle_ns=codec.cycle_ns,
                age_ns=None,
                pace=Pace.MISSING,
            )
