"""The bench as tests see it. Waiting and judging are the same whatever is driven."""

import math
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from bus.frame import Frame
from dbc import FOLDER
from dbc.errors import DecodeError
from testbench.api.driven import Driven
from testbench.expect.condition import Condition, value_of
from testbench.expect.signals import AnySignal, BusSignal, TrueSignal, find_signal


class NotMet(AssertionError):
    """A condition did not hold as it should; the message has what was seen instead."""


class BenchEnded(Exception):
    """The scenario, or a process of the bench, ended while a test waited."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When a condition held: time on the bench's clock [s], and the value in the signal's unit."""

    time_s: float
    value: float


class Bench:
    """One bench under test, as an async context manager. Made by `lockstep`, `realtime` or `on_bus`."""

    def __init__(self, driven: Driven, keep: Path | None = None) -> None:
        """keep: folder that receives the recording at the end."""
        self._driven = driven
        self._keep = keep
        self._latest: dict[str, tuple[float, dict[str, float]]] = {}

    @classmethod
    def lockstep(cls, scenario: str | Path, *, keep: Path | None = None, **choice: Any) -> Self:
        """Plant and ECU on a virtual clock. scenario: a shipped name or a file; choice: fields of `hil.compose.Choice`."""
        from testbench.api.lockstep import LockstepDriven

        return cls(LockstepDriven(str(scenario), choice), keep)

    @classmethod
    def realtime(
        cls,
        scenario: str | Path,
        *,
        ecu: str | None = None,
        keep: Path | None = None,
        seed: int | None = None,
    ) -> Self:
        """Plant, gateway and ECU as processes. ecu: address of the bus of a real one, which then takes the ECU's place."""
        from testbench.api.realtime import RealtimeDriven

        return cls(RealtimeDriven(str(scenario), ecu, seed), keep)

    @classmethod
    def on_bus(
        cls,
        address: str,
        *,
        simulate: Sequence[str] = ("Machine",),
        dbc: Path = FOLDER / "loader.dbc",
        values: Path | None = None,
        keep: Path | None = None,
    ) -> Self:
        """A real controller on a bus with simulated nodes around it; no plant. values: see docs/howto/rest-bus.md."""
        from testbench.api.onbus import BusDriven

        return cls(BusDriven(address, tuple(simulate), dbc, values), keep)

    async def __aenter__(self) -> Self:
        await self._driven.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._driven.stop()
        if self._keep is not None:
            self._driven.keep(self._keep)

    @property
    def now_s(self) -> float:
        """Time on the bench's clock [s]."""
        return self._driven.now_s

    @property
    def frames(self) -> Sequence[Frame]:
        """Everything that was on the bus so far."""
        return self._driven.record

    def keep(self, folder: Path) -> Path:
        """Leave the recording in a folder, after the bench has ended; the folder."""
        return self._driven.keep(folder)

    def value(self, name: str) -> float:
        """The newest value of `Message.Signal` or `truth.FIELD`; NaN before the first, and for *not available*."""
        signal = find_signal(name, self._driven.database)
        if isinstance(signal, TrueSignal):
            return self._true(signal)
        _, values = self._latest.get(signal.message, (math.nan, {}))
        return sample(signal, values)

    async def run_for(self, seconds: float) -> None:
        """Let time pass. BenchEnded if the scenario is over before."""
        async for _ in self._until(self.now_s + seconds):
            pass

    # the word of other test systems for the same
    step = run_for

    async def stimulate(self, name: str, value: float | str) -> None:
        """From now on whoever receives `Message.Signal` gets this value (a number in the DBC's unit, or a name of its table).

        On a bench with a plant the machine goes on as it does; only what is received changes, with a right CRC.
        """
        signal = find_signal(name, self._driven.database)
        if not isinstance(signal, BusSignal):
            raise NotMet(f"{name}: only signals of the bus can be stimulated")
        self._driven.stimulate(signal.message, signal.signal.name, value_of(value, signal))

    async def inject(self, **fault: object) -> str:
        """A fault by the keys of a [[fault]] table: `inject(kind="drop", message="BodyRates", for_s=0.5)`."""
        return self._driven.inject(fault)

    async def clear(self) -> None:
        """End every stimulus and fault."""
        self._driven.clear()

    async def wait_for(self, condition: str, *, within_s: float) -> Moment:
        """The first moment at which a condition holds, the present one included. NotMet after `within_s` on the bench's clock."""
        parsed = Condition.parse(condition, self._driven.database)
        started_s = self.now_s
        # what holds already must not wait for another frame: an event message may never come again
        present = self.value(parsed.signal.name)
        if _holds(parsed, present):
            return Moment(started_s, present)
        seen = [] if math.isnan(present) else [present]
        async for time_s, value in self._samples(parsed.signal, started_s + within_s):
            if _holds(parsed, value):
                return Moment(time_s, value)
            seen.append(value)
        raise NotMet(
            f"{condition} within {_shown_s(within_s)} of {started_s:.3f} s: {_seen(parsed.signal, seen)}"
        )

    async def expect(self, condition: str, *, within_s: float) -> Moment:
        """`wait_for` for what has to come: the test fails where it does not."""
        return await self.wait_for(condition, within_s=within_s)

    async def holds(self, condition: str, *, for_s: float) -> None:
        """A condition holds in every sample of the next `for_s`; NotMet with the first one in which it does not."""
        parsed = Condition.parse(condition, self._driven.database)
        # the present value is not judged: a test calls this right after its stimulus, before a frame shows it
        started_s, count = self.now_s, 0
        async for time_s, value in self._samples(parsed.signal, started_s + for_s):
            count += 1
            if not _holds(parsed, value):
                raise NotMet(
                    f"{condition} for {_shown_s(for_s)}: {parsed.signal.shown(value)} at {time_s:.3f} s"
                )
        # without a sample nothing was shown: silence must not pass as steadiness
        if not count:
            raise NotMet(f"{condition} for {_shown_s(for_s)}: no {parsed.signal.name} came")

    async def _samples(self, signal: AnySignal, until_s: float) -> AsyncIterator[tuple[float, float]]:
        """Time and value of each new sample of a signal."""
        async for frames in self._until(until_s):
            if isinstance(signal, TrueSignal):
                yield self.now_s, self._true(signal)
                continue
            codec = self._driven.database.by_name[signal.message]
            for frame in frames:
                # a frame of another length cannot be decoded; `check` and `conform` report it
                if frame.can_id == codec.can_id and len(frame.data) == codec.length:
                    yield frame.at_ns * 1e-9, sample(signal, codec.decode_dict(frame.data))

    async def _until(self, until_s: float) -> AsyncIterator[Sequence[Frame]]:
        """The frames that come until a time, as they come."""
        # nanoseconds times 1e-9 may fall short of the time asked for by a rounding, which would cost a tick
        while self.now_s < until_s - 1e-9:
            frames = await self._driven.advance(until_s)
            if frames is None:
                raise BenchEnded(f"the bench ended at {self.now_s:.2f} s, before {until_s:.2f} s")
            for frame in frames:
                self._note(frame)
            yield frames

    def _note(self, frame: Frame) -> None:
        """Remember the newest values of a message; a frame that cannot be decoded leaves the old ones."""
        codec = self._driven.database.by_id.get(frame.can_id)
        if codec is None or len(frame.data) != codec.length:
            return
        try:
            self._latest[codec.name] = frame.at_ns * 1e-9, codec.decode_dict(frame.data)
        except DecodeError:
            return

    def _true(self, signal: TrueSignal) -> float:
        # a scalar and a vector are read alike; without a plant the field is missing and its value NaN
        found = np.atleast_1d(np.asarray(self._driven.truth().get(signal.field, math.nan), float))
        return float(found[signal.part or 0])


def sample(signal: BusSignal, values: Mapping[str, float]) -> float:
    """A decoded value as conditions compare it: NaN where it is absent or says *not available* without a table."""
    value = float(values.get(signal.signal.name, math.nan))
    missing = signal.signal.not_available
    if missing is None or signal.signal.choices:
        return value
    absent = missing * signal.signal.scale + signal.signal.offset
    # half a step of the raw value: the decoded float need not equal the product exactly
    return math.nan if abs(value - absent) < abs(signal.signal.scale) / 2 else value


def _holds(condition: Condition, value: float) -> bool:
    return bool(condition.holds(np.array([value]))[0])


def _shown_s(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms" if seconds < 1 else f"{seconds:g} s"


def _seen(signal: AnySignal, values: Sequence[float]) -> str:
    """What was seen instead, in words."""
    if not values:
        return f"no {signal.name} came"
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return f"{signal.name} was never available"
    if signal.labels:
        names = ", ".join(dict.fromkeys(signal.shown(value) for value in known))
        return f"{signal.name} was {names}"
    return f"{signal.name} was {signal.shown(min(known))} to {signal.shown(max(known))}, last {signal.shown(known[-1])}"
