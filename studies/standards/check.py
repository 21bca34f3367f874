"""One requirement of a standard: permitted value, measured value, verdict."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hil.ending import Ending
from hil.verdict import Result
from plant.sheets.machine import Machine
from plant.unit.equipment import Equipment

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Clause:
    """Where a requirement is from. verified: whether it was read in the source named; else it is from memory."""

    source: str
    detail: str
    verified: bool

    @property
    def mark(self) -> str:
        """The source, with a star where the formula is unverified."""
        return self.source if self.verified else f"{self.source} *"

    @property
    def text(self) -> str:
        """Source and detail in full."""
        return f"{self.source}: {self.detail}{'' if self.verified else ' (unverified formula)'}"


@dataclass(frozen=True, slots=True)
class Bound:
    """The most or the least that is permitted."""

    sense: Literal["at most", "at least"]
    value: float
    clause: Clause


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One measured figure in `unit`. bound: None for a figure that only informs; measured: NaN if there is none."""

    what: str
    unit: str
    measured: float
    bound: Bound | None = None

    @property
    def result(self) -> Result | None:
        """PASSED or FAILED by the bound, INCONCLUSIVE without a figure, None without a bound."""
        if self.bound is None:
            return None
        if math.isnan(self.measured):
            return Result.INCONCLUSIVE
        kept = (
            self.measured <= self.bound.value
            if self.bound.sense == "at most"
            else self.measured >= self.bound.value
        )
        return Result.PASSED if kept else Result.FAILED


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a chart; dashed lines are bounds."""

    name: str
    x: Array
    y: Array
    dashed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Lines over a common pair of axes; equal: both axes have one scale, as on a map."""

    title: str
    x: str
    y: str
    lines: tuple[Line, ...]
    equal: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """The machine under test, with what is fitted to it."""

    name: str
    machine: Machine
    equipment: Equipment

    @property
    def rated_payload(self) -> float:
        """What its bucket is made to carry [kg]."""
        return self.machine.payload.reference_mass


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What one standard's test found."""

    checks: tuple[Check, ...]
    charts: tuple[Chart, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Standard:
    """A test of this bench. method: what is done, in a few sentences for the page."""

    name: str
    title: str
    method: str
    perform: Callable[[Candidate], Findings]


def ending_of(checks: list[Check]) -> Ending:
    """FAILED if any bound is broken, else INCONCLUSIVE if any figure is missing."""
    results = {check.result for check in checks}
    if Result.FAILED in results:
        return Ending.FAILED
    return Ending.INCONCLUSIVE if Result.INCONCLUSIVE in results else Ending.PASSED
