"""Parameters of a machine from its drives: one joint fit of the loader's model, by the estimation part of the diagnosis.

No effect is searched. The model's own parameters are freed with the priors of the sheet, or of weighings. The rows are whitened by an
autoregression of what the fit leaves; what the initial states of the segments may do is part of that noise. The noise of the measured inputs
is corrected for afterwards (input_noise).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from discrepancy import gates
from discrepancy.decision.adequacy import adequacy
from discrepancy.decision.summary import ALONE
from discrepancy.estimation.fit import Fit, fit, initial_uncertainty
from discrepancy.estimation.noise import Noise, estimate_noise, white_noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.examine import usable
from discrepancy.model.description import Model
from discrepancy.selection.screen import jackknife, time_blocks_of
from discrepancy.selection.state import State
from discrepancy.signals.adequacy import ChannelAdequacy, inadequate
from discrepancy.signals.recording import Complaint, Recording
from identify.ends import NORMAL_95
from identify.machine.balances import JointPrior, balances_at, derivatives
from identify.machine.coordinates import Coordinates
from identify.machine.input_noise import corrected
from identify.machine.parameters import Quantity, quantities
from plant.sheets.machine import Machine
from plant.unit.equipment import load_equipment

Array = NDArray[np.float64]

PASSES: Final = (
    3  # of noise and fit, which depend on each other; the third changes figures in the fifth digit
)
DETERMINED: Final = 0.5  # posterior over prior standard deviation, up to which drives determine a parameter
AS_WIDE: Final = 0.9  # of it, beyond which the drives have hardly narrowed what was known before
TOGETHER: Final = 0.95  # correlation beyond which only a combination of two parameters is determined

Build = Callable[[Sequence[Recording]], Model]
"""The model of an identification for some recordings."""
Status = Literal["determined", "in part", "not determined"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimated:
    """One quantity with its interval, beside the sheet."""

    quantity: Quantity
    value: float
    lower: float  # 95 % interval
    upper: float
    sheet: float
    prior: tuple[float, float]  # 95 % interval of the prior
    remaining: float  # posterior over prior standard deviation: near 0 the drives determine it, at 1 they add nothing
    off_sheet: float  # distance from the prior's mean in its standard deviations

    @property
    def status(self) -> Status:
        """How well the drives determine it."""
        if self.remaining <= DETERMINED:
            return "determined"
        return "in part" if self.remaining <= AS_WIDE else "not determined"

    @property
    def conflict(self) -> bool:
        """Whether it lies further from the sheet than the sheet's accuracy allows."""
        return self.off_sheet > gates.PRIOR_CONFLICT.threshold


@dataclass(frozen=True, slots=True)
class Pair:
    """Two parameters of which only a combination is determined."""

    first: Quantity
    second: Quantity
    correlation: float
    slope: float  # change of the second by one unit of the first, in the quantities' units
    rest_sd: float  # of the second where the first is known


@dataclass(frozen=True)
class Identified:
    """The result of one identification. Parameters go in the order of `names`."""

    machine: Machine
    build: Build
    model: Model  # with the parameters that a reader knows
    problem: Problem  # in the coordinates of the fit
    coordinates: Coordinates
    noise: Noise
    fit: Fit
    channels: Sequence[ChannelAdequacy]
    complaints: Sequence[Complaint]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the fitted parameters, as the model has them."""
        known = {f: n for n, f in zip(self._of_model, self.coordinates.fitted(self._of_model), strict=True)}
        return tuple(known[name] for name in self.fit.names)

    @property
    def _of_model(self) -> list[str]:
        return [p.name for p in self.model.nuisances if p.scope == "all"]

    @cached_property
    def values(self) -> dict[str, float]:
        """Of the model's parameters."""
        known = self.coordinates.of_model(self.fit.values.shared)
        return {name: known[name] for name in self.names}

    @cached_property
    def of_parameters(self) -> Fit:
        """The fit by the model's own parameters, in the order of `names`."""
        back = np.linalg.inv(self.coordinates.jacobian(self.names))
        return replace(
            self.fit,
            names=self.names,
            columns=self.fit.columns @ back,
            information=back.T @ self.fit.information @ back,
        )

    @cached_property
    def inflation(self) -> Array:
        """Of each variance (k,): that by blocks of time over that by white innovations, at least 1, as in the findings of a diagnosis.

        Where the model is wrong somewhere, blocks of time disagree by more than noise allows.
        """
        white, blocks = np.diag(self.of_parameters.covariance), time_blocks_of(self.noise)
        by_blocks = jackknife(self.of_parameters, blocks, ALONE)
        # Student: the variance by blocks is itself estimated, from a few of them
        wider = (float(student.ppf(0.975, max(int(blocks.max()), 1))) / NORMAL_95) ** 2
        scale = np.where(white > 0.0, white, 1.0)
        # blocks that disagree about what only the prior knows cannot take away what the prior knows
        most = np.maximum(1.0, np.array([self.priors[n][1] for n in self.names]) ** 2 / scale)
        return np.asarray(np.clip(wider * by_blocks / scale, 1.0, most), float)

    @cached_property
    def covariance(self) -> Array:
        """Of the model's parameters (k, k), by linearisation, at least as wide as blocks of time disagree."""
        wider = np.sqrt(self.inflation)
        return np.asarray(self.of_parameters.covariance * np.outer(wider, wider), float)

    @cached_property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Mean and standard deviation before the drives, by parameter."""
        own = {n: self.model.parameter(n) for n in self.names}
        found = {n: (p.value, p.prior_sd or np.inf) for n, p in own.items()}
        joint = self.coordinates.prior
        if joint is not None:
            sds = np.sqrt(np.diag(joint.covariance))
            found |= dict(zip(joint.names, zip(joint.mean.tolist(), sds.tolist(), strict=True), strict=True))
        return found

    @cached_property
    def quantities(self) -> list[Quantity]:
        return quantities(self.machine, self.model)

    def sd(self, name: str) -> float:
        """Standard deviation of a parameter of the model."""
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    @cached_property
    def estimates(self) -> list[Estimated]:
        """All quantities, those of the machine first."""
        return [self._estimated(q) for q in self.quantities]

    def _estimated(self, q: Quantity) -> Estimated:
        at, sd = self.values[q.parameter], self.sd(q.parameter)
        mean, prior_sd = self.priors[q.parameter]
        p = self.model.parameter(q.parameter)

        def interval(centre: float, size: float) -> tuple[float, float]:
            half = NORMAL_95 * size
            low, high = max(centre - half, p.lower), min(centre + half, p.upper)
            return q.value(low), q.value(high)

        lower, upper = interval(at, sd)
        return Estimated(
            quantity=q,
            value=q.value(at),
            lower=lower,
            upper=upper,
            sheet=q.value(p.value),
            prior=interval(mean, prior_sd),
            remaining=sd / prior_sd,
            off_sheet=abs(at - mean) / prior_sd,
        )

    @cached_property
    def pairs(self) -> list[Pair]:
        """Pairs of which only a combination is determined, the closest first."""
        C, found = self.covariance, []
        sds = np.sqrt(np.diag(C))
        by_name = {q.parameter: q for q in self.quantities}
        for i, first in enumerate(self.names):
            for j in range(i + 1, len(self.names)):
                r = C[i, j] / (sds[i] * sds[j])
                if abs(r) <= TOGETHER:
                    continue
                a, b = by_name[first], by_name[self.names[j]]
                units = _slope(b, self.values[b.parameter]) / _slope(a, self.values[a.parameter])
                rest = sds[j] * np.sqrt(max(1.0 - r * r, 0.0)) * _slope(b, self.values[b.parameter])
                found.append(Pair(a, b, float(r), float(units * C[i, j] / C[i, i]), float(rest)))
        return sorted(found, key=lambda p: -abs(p.correlation))

    @cached_property
    def sums(self) -> list[tuple[str, str, float, float]]:
        """Name, unit, value and standard deviation of what all bodies have together: mass, and place of the centre of gravity."""
        total = balances_at(self.machine, self.values)
        slopes = derivatives(self.machine, self.values, self.names)
        mass, rear, front, height = total
        forward = rear + front
        places = {
            "mass without payload": ("kg", mass, slopes[0]),
            "centre of gravity, forward of the joint": (
                "m",
                forward / mass,
                (slopes[1] + slopes[2] - forward / mass * slopes[0]) / mass,
            ),
            "centre of gravity, above ground": (
                "m",
                height / mass,
                (slopes[3] - height / mass * slopes[0]) / mass,
            ),
        }
        return [
            (name, unit, float(value), float(np.sqrt(by @ self.covariance @ by)))
            for name, (unit, value, by) in places.items()
        ]

    @property
    def inadequate(self) -> list[ChannelAdequacy]:
        """Channels that the fitted model does not describe within their budget."""
        return inadequate(list(self.channels))

    @property
    def recordings(self) -> tuple[str, ...]:
        return tuple(r.name for r in self.problem.recordings)


def _slope(q: Quantity, at: float) -> float:
    """Of a quantity by its parameter."""
    return (q.value(at + 1e-6) - q.value(at - 1e-6)) / 2e-6


def identified(
    machine: Machine,
    build: Build,
    recordings: Sequence[Recording],
    prior: JointPrior | None = None,
    complaints: Sequence[Complaint] = (),
) -> Identified:
    """The joint fit of all shared nuisances of the model to all recordings.

    machine: the sheet's, which the model of `build` starts from; prior: of weighings, in place of the sheet's. Raises discrepancy's Unusable where no recording can be used.
    """
    model, coordinates = build(recordings), Coordinates(prior)
    problem, failed = usable(coordinates.model(model), recordings)
    noise, found = fitted(problem)
    sensors = load_equipment(machine.family).sensors
    found = corrected(problem, noise, found, lambda some: coordinates.model(build(some)), sensors)
    state = State(noise, found, (), ())
    channels = adequacy(problem, state, state)
    said = [*complaints, *problem.complaints, *failed]
    return Identified(machine, build, model, problem, coordinates, noise, found, channels, said)


def fitted(problem: Problem) -> tuple[Noise, Fit]:
    """Noise and fit of all shared nuisances, which depend on each other and are found in turns."""
    values, names = problem.start(), problem.nuisance_names
    base = problem.predict(values)
    noise = white_noise(problem, problem.measured - base, initial_uncertainty(problem, values, base))
    found = fit(problem, noise, names, values)
    for _ in range(PASSES):
        # the warm-up runs before the segments get the fitted machine too
        values = problem.warmed_up(found.values, found.values)
        noise = renewed(problem, noise, values)
        found = fit(problem, noise, names, values)
    return noise, found


def renewed(problem: Problem, noise: Noise, values: Values) -> Noise:
    """The noise that the model leaves at these values."""
    base = problem.predict(values)
    known = noise.having(problem, initial_uncertainty(problem, values, base))
    return estimate_noise(problem, problem.measured - base, len(problem.nuisance_names), known)
