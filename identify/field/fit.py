"""A tyre from points of settled slip and force; the error of the effective radius and of the force's scale are unknowns with priors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from discrepancy.estimation.autoregression import Whitener
from identify.ends import NORMAL_95, ProfileInterval
from identify.field.chain import RATE_HZ, WINDOW_S, Event, FieldResult, Points
from identify.field.lag import COMPLIANCES, behind_carcass
from identify.tyre.combined import weight
from identify.tyre.curve import steady
from identify.tyre.estimate import Estimate, Noise, estimate, prior_cost
from identify.tyre.parameters import COMBINED, INDEX, NAMES, START, TYPICAL, WIDE, Nominal, curve, vector
from identify.tyre.rig_problem import Part, Unknown

Array = NDArray[np.float64]

SMALL_SLIP = 0.1  # up to this largest slip the data determine only the stiffness
FEWEST = 12  # points from which the size of their errors is estimated
SMALL_ANGLE = (
    0.01  # tangent of the slip angle up to which a tyre loses less than 1 % of its longitudinal force
)
SHAPES = ({"PCX1": 1.3, "PEX1": -1.0}, {"PCX1": 1.3, "PEX1": 0.3}, {"PCX1": 1.7, "PEX1": 0.7})
"""Further starts of the curve's shape: a round peak, a usual one, and a sharp one."""
HUBER = 3.0  # standard deviations beyond which a residual counts in proportion, not squared
SHIFT = "slip zero"  # an error of the effective radius acts as a shift of all slips
HEADING = "heading zero"  # [rad]: the markers are not exactly in the wheel's plane
COMPLIANCE = "carcass compliance"  # [m/N]
COMPLIANCE_PRIOR = 1.5e-6  # tyres of this size have carcasses of 0.4 to 2 MN/m


@dataclass(frozen=True, slots=True, kw_only=True)
class PointProblem:
    """Points, unknown parameters of the tyre, values of the others; scale: standard deviation of each point's residual (n,) [N]."""

    points: Points
    events: Sequence[Event]
    nominal: Nominal
    tyre: Sequence[str]
    scale: Array
    fixed: Mapping[str, float] = field(default_factory=dict)
    gain_sd: float = 0.005
    shift_sd: float = 0.01
    heading_sd: float = 0.01  # half a degree: so well markers are put in the plane of a wheel
    compliance_sd: float = 1e-6
    lagging: CubicSpline | None = (
        None  # how far slip lags at each point, over the compliance; None: it has settled
    )

    @property
    def combined(self) -> bool:
        """Whether slip angles weigh the force."""
        return set(COMBINED) <= set(self.tyre)

    @property
    def unknowns(self) -> list[Unknown]:
        out = [
            Unknown(
                name=n,
                start=float(np.clip(self.fixed.get(n, START.get(n, 0.0)), *WIDE[n])),
                lower=WIDE[n][0],
                upper=WIDE[n][1],
                typical=TYPICAL[n],
            )
            for n in self.tyre
        ]
        out.append(
            Unknown(
                name="gain",
                start=1.0,
                lower=0.8,
                upper=1.2,
                typical=0.01,
                prior=1.0,
                prior_sd=max(self.gain_sd, 1e-6),
            )
        )
        out.append(
            Unknown(name=SHIFT, start=0.0, lower=-0.1, upper=0.1, typical=2e-3, prior_sd=self.shift_sd)
        )
        out.append(Unknown(name="tare", start=0.0, lower=-5e3, upper=5e3, typical=50.0, prior_sd=50.0))
        if self.combined:
            out.append(
                Unknown(
                    name=HEADING, start=0.0, lower=-0.1, upper=0.1, typical=2e-3, prior_sd=self.heading_sd
                )
            )
        # points that have settled do not depend on it
        out.append(
            Unknown(
                name=COMPLIANCE,
                start=COMPLIANCE_PRIOR,
                lower=float(COMPLIANCES[0]),
                upper=float(COMPLIANCES[-1]),
                typical=1e-7,
                prior=COMPLIANCE_PRIOR,
                prior_sd=self.compliance_sd,
            )
        )
        return out

    def held_at(self, values: Mapping[str, float]) -> "PointProblem":
        """The lag of the slip behind a carcass follows the curve of these values; only its compliance changes during a fit."""
        p, points, window = self._numbers(values), self.points, round(WINDOW_S * RATE_HZ)
        lag = np.empty((COMPLIANCES.size, points.slip.size))
        for number in np.unique(points.event):
            own = np.flatnonzero(points.event == number)
            load = float(np.median(points.load[own])) / values["gain"]
            slip, speed = self.events[number].bridged()
            # (a point's slip angle has settled, and so has its event's)
            side = np.full(slip.size, np.median(points.side_slip[own]))
            true = _turning(values, slip, side) * (1.0 + values[SHIFT]) - 1.0
            behind = behind_carcass(
                curve(p, self.nominal, load, self.nominal.pressure)[0], true, speed, 1.0 / RATE_HZ
            )
            for i in own:
                part = slice(points.first[i], points.first[i] + window)
                lag[:, i] = np.mean(behind[:, part] - true[part], axis=1)
        return replace(self, lagging=CubicSpline(COMPLIANCES, lag))

    def _numbers(self, values: Mapping[str, float]) -> Array:
        """All parameters of the tyre, as `curve` takes them."""
        return vector(
            {
                **{n: v for n, v in self.fixed.items() if n in INDEX},
                **{n: values[n] for n in self.tyre if n in INDEX},
            }
        )

    def parts(self, values: Mapping[str, float]) -> list[Part]:
        index = {name: i for i, name in enumerate(values)}
        p, gain = self._numbers(values), values["gain"]
        load = self.points.load / gain  # both forces have the scale of one transducer
        n = load.size
        made = [curve(p, self.nominal, float(one), self.nominal.pressure) for one in load]
        curves = np.stack([m[0] for m in made])
        turning = _turning(values, self.points.slip, self.points.side_slip)
        kappa = turning * (1.0 + values[SHIFT]) - 1.0
        by_compliance = np.zeros(n)
        if self.lagging is not None:
            kappa = kappa + self.lagging(values[COMPLIANCE])
            by_compliance = self.lagging(values[COMPLIANCE], 1)
        force, by = np.empty(n), np.empty((n, 7))
        steady(curves, kappa, force, by)
        by_slip = by[:, 5]  # the derivative by the shift is that by the slip
        of_angle, of_heading = dict[str, Array](), dict[str, Array]()
        if self.combined:
            tan_alpha = slip_angle(values, self.points.side_slip)
            share, by_weight = weight(kappa, tan_alpha, *(values[n] for n in COMBINED))
            of_angle = {n: gain * force * by_weight[n] for n in COMBINED}
            by_slip = share * by_slip + force * by_weight["kappa"]
            by_angle = force * by_weight["tan_alpha"] * (1.0 + tan_alpha**2)
            of_heading = {HEADING: gain * (by_angle + by_slip * turning * (1.0 + values[SHIFT]) * tan_alpha)}
            force, by = share * force, share[:, None] * by
        columns = {
            name: gain * np.einsum("ij,ij->i", by, np.stack([m[1][:, INDEX[name]] for m in made]))
            for name in self.tyre
            if name in INDEX
        }
        columns |= of_angle
        columns["gain"] = force - np.einsum("ij,ij->i", by, np.stack([m[2] for m in made])) * load
        columns[SHIFT] = gain * by_slip * turning
        columns["tare"] = np.ones(n)
        columns |= of_heading
        columns[COMPLIANCE] = gain * by_slip * by_compliance
        J = np.stack(list(columns.values()), axis=1) / self.scale[:, None]
        residual = (gain * force + values["tare"] - self.points.force) / self.scale
        return [
            Part(
                residual,
                J,
                np.eye(len(columns)),
                np.array([index[c] for c in columns], np.intp),
                np.ones(n, bool),
            )
        ]


def slip_angle(values: Mapping[str, float], side_slip: Array) -> Array:
    """Tangent of the slip angle (n,) without the error of the markers' heading."""
    return np.tan(np.arctan(side_slip) + values.get(HEADING, 0.0))


def _turning(values: Mapping[str, float], slip: Array, side_slip: Array) -> Array:
    """1 + slip (n,) without the error of the markers' heading: the speed was taken along it, and at a slip angle that is another speed."""
    seen = np.arctan(side_slip)
    return np.asarray((1.0 + slip) * np.cos(seen) / np.cos(seen + values.get(HEADING, 0.0)), float)


def parameters_for(points: Points) -> tuple[str, ...]:
    """Parameters that the points determine: only the stiffness at small slips, else the whole curve; changes with load where loads differ, and what slip angles take where there are any."""
    names = ["PKX1"]
    if float(np.max(np.abs(points.slip))) > SMALL_SLIP:
        names = ["PCX1", "PDX1", "PEX1", "PKX1"]
    if np.ptp(points.load) > 0.2 * float(np.mean(points.load)):
        names += ["PKX3"] if len(names) == 1 else ["PDX2", "PKX3"]
    if float(np.max(np.abs(points.side_slip))) > SMALL_ANGLE:
        names += COMBINED
    return tuple(names)


def fit_points(result: FieldResult, *, friction: float = 0.75) -> tuple[PointProblem, Estimate]:
    """The tyre of maximum likelihood. friction: assumed where the slips are too small to determine it."""
    points = result.points
    names = parameters_for(points)
    force_sd, slip_sd = _pooled(points)

    def problem_with(scale: Array) -> PointProblem:
        return PointProblem(
            points=points,
            events=result.events,
            nominal=result.log.nominal,
            tyre=names,
            scale=scale,
            fixed={"PCX1": 1.4, "PDX1": friction, "PEX1": 0.0},
            gain_sd=result.log.gain_sd,
        )

    # first weights: 8 is a plausible slip stiffness per load, until the fit gives the slope itself
    problem = problem_with(np.hypot(force_sd, 8.0 * points.load * slip_sd))
    # far from the curve a fit could take the lag for none, where its derivative is nearly 0
    problem = replace(problem, compliance_sd=1e-3 * COMPLIANCE_PRIOR)
    found = _fits(problem, {}, _plain(problem, None))[0]
    # the slope of the curve where a point lies weighs the error of its slip
    for _ in range(3):
        problem = problem.held_at(found.values)
        [part] = problem.parts(found.values)
        slope = np.abs(part.by[:, found.names.index(SHIFT)]) * problem.scale
        expected = _sized(
            part.residual * problem.scale, force_sd, slope * slip_sd, points.slip.size - len(found.names)
        )
        problem = replace(problem_with(expected), lagging=problem.lagging)
        weights = _plain(problem, problem.parts(found.values)[0].residual)
        found, *others = _fits(problem, found.values, weights)
    problem = problem.held_at(found.values)
    found = replace(found, inflation=_together(found, problem))
    return problem, replace(found, profiled=_of_all_optima(problem, found, others))


def _fits(problem: PointProblem, start: Mapping[str, float], noise: Noise) -> list[Estimate]:
    """Fits from several starts, the one of least cost first.

    From one start, one fit in a hundred ended at a sharp peak (curvature near 1) that the points do not have.
    """
    if "PEX1" not in problem.tyre:
        return [estimate(problem, start, noise=noise)]
    found = [estimate(problem, {**start, **shape}, noise=noise) for shape in ({}, *SHAPES)]
    return sorted(found, key=lambda one: _cost(problem, one))


def _cost(problem: PointProblem, found: Estimate) -> float:
    return found.sse + prior_cost(problem.unknowns, found.values)


def _of_all_optima(
    problem: PointProblem, found: Estimate, others: Sequence[Estimate]
) -> Mapping[str, ProfileInterval]:
    """Intervals over all optima that the data do not distinguish from the best one; empty where it is the only one.

    With few slips beyond the peak, a round curve and a sharp one can have the same likelihood: an interval about one of them denies the other.
    """
    near = [
        replace(one, inflation=found.inflation)
        for one in others
        if (_cost(problem, one) - _cost(problem, found)) / found.scatter < NORMAL_95**2
    ]
    own = {n: found.interval(n) for n in problem.tyre}
    if all(own[n].lower < one.values[n] < own[n].upper for one in near for n in problem.tyre):
        return {}
    out = {}
    for n, i in own.items():
        spans = [i, *(one.interval(n) for one in near)]
        out[n] = ProfileInterval(
            lower=min(s.lower for s in spans), upper=max(s.upper for s in spans), linear=(i.lower, i.upper)
        )
    return out


def _sized(misfit: Array, force_sd: Array, slip_sd: Array, freedom: int) -> Array:
    """Standard deviation of each point [N] (n,): those expected of force and of slip, each with the size that the scatter about the curve shows.

    Errors of the slip outweigh those of the force where the curve is steep; both sizes can be read where one of them does.
    """
    # the fit has bent towards the points
    free = np.sqrt(misfit.size / max(freedom, 1))
    expected = np.hypot(force_sd, slip_sd)
    steep = slip_sd > force_sd
    sizes = []
    for group in (~steep, steep):
        own = group if np.count_nonzero(group) >= FEWEST else np.ones(misfit.size, bool)
        # (1.4826 x median of |e| is the standard deviation of Gaussian errors, and outliers do not move it)
        sizes.append(max(1.4826 * free * float(np.median(np.abs(misfit[own] / expected[own]))), 0.2))
    return np.hypot(sizes[0] * force_sd, sizes[1] * slip_sd)


def _pooled(points: Points) -> tuple[Array, Array]:
    """Standard deviations of force and slip of each point (n,), each from all of them.

    One window has a few independent values: weighed by its own scatter, the windows that scatter least by chance would count most.
    """
    sliding = float(np.median(points.slip_sd * np.abs(points.speed) / (1.0 + np.abs(points.slip))))
    force = max(30.0, float(np.median(points.force_sd)))
    return (
        np.maximum(force, 0.5 * points.force_sd),
        sliding * (1.0 + np.abs(points.slip)) / np.abs(points.speed),
    )


def _together(found: Estimate, problem: PointProblem) -> float:
    """Variance of the means of events over that of independent points, 1 at least: points of an event share errors of the clock and of the radius."""
    [part] = problem.parts(dict(found.values))
    residual = part.residual * found.noise.weights[0]
    events = [residual[problem.points.event == e] for e in np.unique(problem.points.event)]
    # all that the data determine bends towards the means of events too
    bent = float(np.trace(found.covariance @ found.of_data)) / found.scatter
    free = max(1.0 - bent / max(len(events), 1), 0.3)
    shared = float(np.mean([e.size * np.mean(e) ** 2 for e in events])) / free
    return max(1.0, shared / max(1e-9, found.sse / max(found.rows - len(found.names), 1)))


def _plain(problem: PointProblem, residual: Array | None) -> Noise:
    """Independent points, Huber's weights."""
    n = problem.points.slip.size
    weight = np.ones(n)
    if residual is not None:
        size = max(1.0, 1.4826 * float(np.median(np.abs(residual))))
        weight = np.sqrt(np.minimum(1.0, HUBER * size / np.maximum(np.abs(residual), 1e-12)))
    return Noise([Whitener(np.zeros((0, 1, 1)), np.eye(1))], [weight])


__all__ = ["NAMES", "SHIFT", "PointProblem", "fit_points", "parameters_for"]
