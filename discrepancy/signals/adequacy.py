"""How far a model is off, against what the sensors allow: errors and budgets of each output, overall, by time and by regime.

Plain data of findings.json. All errors are root mean squares in the channel's own unit; `before` is the baseline, the other the model with
everything that was accepted.
"""

from dataclasses import dataclass, field
from typing import Final, Literal

from discrepancy.signals.quantities import figures, quantity, readable

STILL_WRONG: Final = "still wrong: "
"""How every sentence begins on an error that is beyond its budget."""
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
        return self.source == "sensor sheet"

    @property
    def one_step_over(self) -> float:
        """One-step error in budgets."""
        return self.one_step / self.budget

    @property
    def simulated_over(self) -> float:
        """Error of a simulation in its budgets."""
        return self.simulated / self.simulated_budget

    @property
    def over(self) -> float:
        """The larger of those that count."""
        return max(self.one_step_over, self.simulated_over) if self.firm else self.simulated_over


def inadequate(channels: list[ChannelAdequacy]) -> list[ChannelAdequacy]:
    """Channels whose error is beyond their budget, the furthest first."""
    return sorted((c for c in channels if not c.adequate), key=lambda c: -c.over)


def left(c: ChannelAdequacy, *, several: bool = False) -> str:
    """'level is simulated to 0.61 V, 3.4 times its budget of 0.18 V, most from 1200 to 1500 s'; several: times name their recording."""
    return f"{_error(c)}{_worst(c, several=several)}"


def _error(c: ChannelAdequacy) -> str:
    simulated = c.over == c.simulated_over
    error, budget = (c.simulated, c.simulated_budget) if simulated else (c.one_step, c.budget)
    how = "is simulated to" if simulated else "is predicted one step ahead to"
    factor, unit = readable(c.unit, max(error, budget))
    sizes = [quantity(value / factor, "", 2) for value in (error, budget)]
    far = f"{figures(error / budget, 2)} times its" if error > 1.05 * budget else "within its"
    return f"{c.channel} {how} {sizes[0]} {unit}".rstrip() + f", {far} budget of {sizes[1]} {unit}".rstrip()


def _worst(c: ChannelAdequacy, *, several: bool) -> str:
    """Time and regime in which most of the error is."""
    found = []
    worst = max((p for p in c.parts if p.over), key=lambda p: _over(c, p), default=None)
    if worst is not None and worst.start_s is not None and worst.end_s is not None:
        found.append(f"from {span(worst.start_s, worst.end_s)}{f' of {worst.recording}' if several else ''}")
    regime = max((p for p in c.regimes if p.over), key=lambda p: _over(c, p), default=None)
    found += [f"where {regime.regime}"] if regime is not None else []
    return f", most {' and '.join(found)}" if found else ""


def span(start_s: float, end_s: float) -> str:
    """'46412.3 to 46415.1 s': as many decimals as the length needs, also where stamps count from midnight."""
    decimals = 0 if end_s - start_s >= 20.0 else 1 if end_s - start_s >= 0.5 else 3
    return f"{start_s:.{decimals}f} to {end_s:.{decimals}f} s"


def _over(c: ChannelAdequacy, part: ErrorPart) -> float:
    return max(part.one_step / c.budget if c.firm else 0.0, part.simulated / c.simulated_budget)
