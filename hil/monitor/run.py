"""The main loop of `loaderhil monitor`: from a source through a view to standard output."""

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Protocol

from hil.ending import Ending
from hil.monitor.output import Closed, Output
from hil.monitor.source import Batch, Buses, Source, signalled
from hil.monitor.target import Target, TargetError
from hil.shell.process import Stop

EVERY_S = 0.25
"""Longest time between two calls of a view while no frame comes [s]: ages in the table go on."""
_REPORT_S = 1.0
"""Shortest time between two reports of lost frames [s]."""


class View(Protocol):
    """Turns batches of frames into text."""

    def text(self, batch: Batch) -> str:
        """The text for a batch; '' for none."""

    def end(self) -> str:
        """The text after the last batch, whatever ended the source."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to watch and when to end."""

    targets: tuple[Target, ...]
    follow: bool = False  # continue while a recording grows
    origins: bool = False  # mark frames that were sent from this machine
    count: int | None = None  # end after this number of frames; None: no such limit
    silence_s: float | None = None  # end after this time without a frame [s]; None: no such limit


def open_source(plan: Plan, watch: tuple[int, ...], stack: ExitStack) -> Source:
    """The source of a plan, closed with `stack`; TargetError if buses and recordings are mixed."""
    recorded = [target for target in plan.targets if target.path is not None]
    if recorded and len(recorded) < len(plan.targets):
        names = ", ".join(target.name for target in plan.targets)
        raise TargetError(f"{names}: buses and recordings have different clocks; monitor one kind at a time")
    if recorded:
        from hil.monitor.recordings import Recordings  # numba, which a bus does not need

        return Recordings(plan.targets, follow=plan.follow)
    if plan.follow:
        raise TargetError("--follow is for a recording that still grows; a bus is followed anyway")
    return stack.enter_context(Buses(plan.targets, origins=plan.origins, watch=watch))


def monitor(plan: Plan, view_of: Callable[[Source, ExitStack], View]) -> Ending:
    """Show what comes until the plan, the recording, the reader of our output or a signal ends it."""
    with Stop() as stop, ExitStack() as stack:
        output = Output(sys.stdout.fileno(), stop)
        source = open_source(plan, output.watchable, stack)
        view = view_of(source, stack)
        reporter = _Reporter(source)
        until = _Until(plan)
        try:
            for batch in source.batches(stop, min(EVERY_S, plan.silence_s or EVERY_S)):
                allowed = until.cut(batch)
                if text := view.text(allowed):
                    output.write(text)
                reporter.report()
                if until.reached:
                    break
        except Closed:
            pass
        finally:
            with suppress(Closed):
                output.write(view.end())
        reporter.finish()
        if not signalled(stop):
            return Ending.PASSED
        print(f"loaderhil: interrupted after {until.frames} frames, {reporter.summary()}", file=sys.stderr)
        return Ending.INTERRUPTED


class _Until:
    """Counts frames and watches for silence."""

    def __init__(self, plan: Plan) -> None:
        self._most, self._silence_s = plan.count, plan.silence_s
        self._heard = time.monotonic()
        self.frames = 0
        self.reached = False

    def cut(self, batch: Batch) -> Batch:
        """The batch, up to the last frame that is wanted."""
        if batch.frames:
            self._heard = time.monotonic()
        elif self._silence_s is not None:
            self.reached = time.monotonic() - self._heard >= self._silence_s
        if self._most is not None and self.frames + len(batch.frames) >= self._most:
            self.reached = True
            batch = batch._replace(frames=batch.frames[: self._most - self.frames])
        self.frames += len(batch.frames)
        return batch


class _Reporter:
    """Reports problems on standard error: warnings at once, lost frames at most once per second."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._reported: dict[str, int] = {}
        self._next = 0.0

    def report(self) -> None:
        """Report the problems since the last call."""
        for warning in self._source.warnings():
            print(f"loaderhil: {warning}", file=sys.stderr)
        if time.monotonic() >= self._next:
            self.finish()

    def finish(self) -> None:
        """Report lost frames that have not been reported yet."""
        for name, total in self._source.lost().items():
            if new := total - self._reported.get(name, 0):
                print(f"loaderhil: fell behind: {new} frames of {name} lost, {total} so far", file=sys.stderr)
                self._next = time.monotonic() + _REPORT_S
            self._reported[name] = total

    def summary(self) -> str:
        """All losses as text."""
        lost = sum(self._source.lost().values())
        return f"{lost} lost" if lost else "none lost"
