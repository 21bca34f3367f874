"""How far a model is off, against what the sensors allow: errors and budgets of each output, overall, by time and by regime.

Plain data of findings.json. All errors are root mean squares in the channel's own unit; `before` is the baseline, the other the model with
everything that was accepted.
"""

import math
from dataclasses import dataclass, field
from typing import Final, Literal

from discrepancy import gates
from discrepancy.signals.quantities import figures, quantity, readable, span

STILL_WRONG: Final = "still wrong: "
"""How every sentence begins on an error that is beyond its budget."""
OVER_SHOWN: Final = 1.05  # of an error over its budget, from which on the sentence gives it
Source = Literal["sensor sheet", "resolution", "standstill", "differences"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorPart:
    """Errors of one channel in a part of one recording, or in a range of a known signal over all of them."""

    recording: str = ""  # empty: all
    start_s: float | None = None  # in the recording's own time
    end_s: float | None = None
    regime: str = ""  # such as 'level above 8.2 V'; empty: a part of time
    one_step_before: float
    one_step: float
    simulated_before: float
    simulated: float
    over: bool  # beyond what a part may have


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelAdequacy:
    """Errors of one channel beside its budget."""

    channel: str
    unit: str
    budget: float  # what the sensor may be off by, one standard deviation
    source: Source  # of the budget
    movement: float  # of the channel, beyond what initial states explain
    one_step_budget: (
        float | None
    )  # the budget with stated disturbances; None: measured only, one-step errors do not decide
    simulated_budget: float  # the budget with what unmeasured disturbances may add over a window
    one_step_before: float
    one_step: float
    simulated_before: float
    simulated: float
    adequate: bool
    parts: list[ErrorPart] = field(default_factory=list)  # by time, in order
    regimes: list[ErrorPart] = field(default_factory=list)  # those with the largest errors

    @property
    def firm(self) -> bool:
        """Whether the budget is known: one measured on the recording is a lower bound, and one-step errors beyond it prove nothing."""
        return self.one_step_budget is not None

    @property
    def over(self) -> float:
        """The larger error in its budgets, of those that count."""
        return self.ratio(self.one_step, self.simulated)

    def ratio(self, one_step: float, simulated: float) -> float:
        """Errors of the channel or of a part of it, the larger one in its budgets."""
        return max(one_step / (self.one_step_budget or math.inf), simulated / self.simulated_budget)


def inadequate(channels: list[ChannelAdequacy]) -> list[ChannelAdequacy]:
    """Channels whose error is beyond their budget, the furthest first."""
    return sorted((c for c in channels if not c.adequate), key=lambda c: -c.over)


def left(c: ChannelAdequacy, *, several: bool = False) -> str:
    """'level is simulated to 0.61 V, 3.4 times its budget of 0.18 V, most from 1200 to 1500 s'; several: times name their recording.

    Where only a part is beyond its budget, the error of that part is given.
    """
    over = [p for p in (*c.parts, *c.regimes) if p.over]
    if over and c.over <= gates.SIMULATED_OVER.threshold:
        worst = max(over, key=lambda p: c.ratio(p.one_step, p.simulated))
        return f"{_error(c, worst.one_step, worst.simulated)} {_place(worst, several=several)}"
    places = [
        _place(max(some, key=lambda p: c.ratio(p.one_step, p.simulated)), several=several)
        for parts in (c.parts, c.regimes)
        if (some := [p for p in parts if p.over])
    ]
    return f"{_error(c, c.one_step, c.simulated)}{', most ' if places else ''}{' and '.join(places)}"


def _error(c: ChannelAdequacy, one_step: float, simulated: float) -> str:
    """'level is simulated to 0.61 V, 3.4 times its budget of 0.18 V'."""
    ahead = c.one_step_budget is not None and one_step / c.one_step_budget > simulated / c.simulated_budget
    error, budget = (one_step, c.one_step_budget or 0.0) if ahead else (simulated, c.simulated_budget)
    how = "is predicted one step ahead to" if ahead else "is simulated to"
    factor, unit = readable(c.unit, max(error, budget))
    sizes = [f"{quantity(value / factor, '', 2)} {unit}".rstrip() for value in (error, budget)]
    far = f"{figures(error / budget, 2)} times its" if error > OVER_SHOWN * budget else "within its"
    return f"{c.channel} {how} {sizes[0]}, {far} budget of {sizes[1]}"


def _place(part: ErrorPart, *, several: bool) -> str:
    """'from 1200 to 1500 s of a.csv', 'where level above 8.2 V'."""
    if part.start_s is None or part.end_s is None:
        return f"where {part.regime}"
    return f"from {span(part.start_s, part.end_s)}{f' of {part.recording}' if several else ''}"
