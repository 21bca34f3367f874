"""Contact patch and vertical stiffness of a tyre, (116) to (118): laws of two terms, linear in their coefficients, fitted by least squares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from identify.tyre.estimate import Interval
from identify.tyre.parameters import Nominal

Array = NDArray[np.float64]
ArrayOrFloat = TypeVar("ArrayOrFloat", Array, np.float64)

FEWEST = 3  # readings: two coefficients and their scatter
DOUBTFUL = 0.01
"""Probability of a constant term by chance, below which the readings are said to have one: a warning, so one false one in a hundred sheets is bearable."""


def deflection(share: ArrayOrFloat, q1: float, q2: float) -> ArrayOrFloat:
    """Deflection over the unloaded radius at loads over the nominal one: the inverse of (118), in the form that holds for q2 = 0 too."""
    return 2.0 * share / (q1 + np.sqrt(q1 * q1 + 4.0 * q2 * share))


def nominal_stiffness(q1: float, q2: float, nominal: Nominal) -> float:
    """Slope of the load over the deflection at nominal load [N/m]: q1 + 2 q2 d, which at 1 = q1 d + q2 d² is the root of the discriminant."""
    return float(nominal.load / nominal.radius * (q1 * q1 + 4.0 * q2) ** 0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """value over `unit` = coefficients[0] x^powers[0] + coefficients[1] x^powers[1], with x over `scale`."""

    title: str
    across: str  # name and unit of x
    upward: str  # name and unit of the value
    coefficients: tuple[str, str]
    powers: tuple[float, float]
    scale: float
    unit: float

    def rows(self, x: Array) -> Array:
        """Derivative of the value by both coefficients (n, 2)."""
        share = x / self.scale
        return self.unit * np.stack([share**p for p in self.powers], axis=1)

    def slopes(self, x: float) -> Array:
        """Derivative of the rows by x (2,)."""
        return np.array([self.unit * p * (x / self.scale) ** (p - 1.0) / self.scale for p in self.powers])


def laws(nominal: Nominal) -> Mapping[str, Law]:
    """By what is read: "deflection" (118), "length" (116), "width" (117); halves of the patch, as the thesis has them."""
    half = {"scale": nominal.load, "unit": nominal.radius}
    return {
        "deflection": Law(
            title="Load over deflection",
            across="deflection [m]",
            upward="load [N]",
            coefficients=("qfz1", "qfz2"),
            powers=(1.0, 2.0),
            scale=nominal.radius,
            unit=nominal.load,
        ),
        "length": Law(
            title="Half length of the contact patch",
            across="load [N]",
            upward="half length [m]",
            coefficients=("qa1", "qa2"),
            powers=(0.5, 1.0),
            **half,
        ),
        "width": Law(
            title="Half width of the contact patch",
            across="load [N]",
            upward="half width [m]",
            coefficients=("qb1", "qb2"),
            powers=(1.0 / 3.0, 1.0),
            **half,
        ),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A law at its least squares, with what its readings scatter."""

    law: Law
    x: Array  # readings (n,)
    value: Array  # (n,)
    coefficients: Array  # (2,)
    covariance: Array  # (2, 2)
    rms: float  # of the residual, in the unit of the value
    constant: (
        float  # a further constant term that the readings ask for, in the unit of the value; 0 if they do not
    )

    @property
    def quantile(self) -> float:
        """Standard deviations of half a 95 % interval: Student's t, as few readings tell little of their own scatter."""
        return float(student.ppf(0.975, self.x.size - 2))

    def interval(self, which: int) -> Interval:
        """Of the first or the second coefficient."""
        gradient = np.zeros(2)
        gradient[which] = 1.0
        return self._interval(gradient)

    def at(self, x: float) -> Interval:
        """Of the law's value at x."""
        return self._interval(self.law.rows(np.array([x]))[0])

    def slope(self, x: float) -> Interval:
        """Of the law's derivative at x."""
        return self._interval(self.law.slopes(x))

    def _interval(self, gradient: Array) -> Interval:
        value, sd = float(gradient @ self.coefficients), float(np.sqrt(gradient @ self.covariance @ gradient))
        half = self.quantile * sd
        return Interval(value=value, sd=sd, lower=value - half, upper=value + half)


def fit(law: Law, x: Array, value: Array) -> Fitted:
    """The law through readings (n,). Raises ValueError where they do not determine both coefficients."""
    rows = law.rows(x)
    n = x.size
    names = " and ".join(law.coefficients)
    if n < FEWEST or np.linalg.matrix_rank(rows / np.abs(rows).max(axis=0)) < 2:
        raise ValueError(
            f"{n} readings do not determine {names}: at least {FEWEST} are needed, two of them different"
        )
    found, _, _, _ = np.linalg.lstsq(rows, value, rcond=None)
    residual = value - rows @ found
    variance = float(residual @ residual) / (n - 2)
    return Fitted(
        law=law,
        x=x,
        value=value,
        coefficients=np.asarray(found, float),
        covariance=np.asarray(variance * np.linalg.inv(rows.T @ rows), float),
        rms=float(np.sqrt(np.mean(residual**2))),
        constant=_constant(rows, value),
    )


def _constant(rows: Array, value: Array) -> float:
    """The constant term that the readings ask for beside the law, or 0: a wrong zero of deflection, or a rim of the print that does not touch."""
    wide = np.column_stack([rows, np.ones(value.size)])
    freedom = value.size - 3
    if freedom < 1 or np.linalg.matrix_rank(wide / np.abs(wide).max(axis=0)) < 3:
        return 0.0
    found, _, _, _ = np.linalg.lstsq(wide, value, rcond=None)
    residual = value - wide @ found
    sd = float(np.sqrt(residual @ residual / freedom * np.linalg.inv(wide.T @ wide)[2, 2]))
    limit = float(student.ppf(1.0 - DOUBTFUL / 2.0, freedom))
    return float(found[2]) if abs(found[2]) > limit * sd + 1e-9 * float(np.abs(value).max()) else 0.0
