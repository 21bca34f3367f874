"""One requirement of a standard: permitted value, measured value, verdict."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hil.verdict import Result
from plant.sheets.machine import Machine
from plant.unit.equipment import Equipment

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Clause:
    """The source of a requirement."""

    source: str
    detail: str  # edition and clause
    verified: bool  # read in the source; else from memory

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
    """The permitted value."""

    sense: Literal["at most", "at least"]
    value: float  # in the unit of the check
    clause: Clause


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One measured value."""

    what: str
    unit: str
    measured: float  # NaN if it could not be measured
    bound: Bound | None = None  # None: for information only

    @property
    def result(self) -> Result | None:
        """PASSED or FAILED by the bound, INCONCLUSIVE without a measured value, None without a bound."""
        if self.bound is None:
            return None
        # before the comparison: NaN is neither above nor below, and would fail every bound
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
    """The machine under test, with its equipment."""

    name: str
    machine: Machine
    equipment: Equipment

    @property
    def rated_payload(self) -> float:
        """Rated payload of its bucket [kg]."""
        return self.machine.payload.reference_mass


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """The result of the test for one standard."""

    checks: tuple[Check, ...]
    charts: tuple[Chart, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Standard:
    """The test for one standard."""

    name: str
    title: str
    method: str  # the procedure in a few sentences, for the page
    perform: Callable[[Candidate], Findings]
