"""The open-ended search: regresses innovations that no effect of the library explains on functions of the known signals, with units.

Each function may act at each port of the model (a force, a yaw moment) or directly on an output. At a port it is simulated, so that it
reaches the outputs through the model's own dynamics. Terms are chosen one by one (orthogonal matching pursuit) under the same penalty and
held-out test as effects of the library. Among terms that fit equally well the simplest is reported, and the others are listed with it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from discrepancy.estimation.fit import Fit, WindowStates, differences
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model, Window
from discrepancy.selection.candidate_fits import folds
from discrepancy.selection.feature_terms import Candidate, Simulated, candidates
from discrepancy.selection.functions import Function
from discrepancy.selection.screen import Projector, penalty, score_variance_inflation, time_blocks_of
from discrepancy.selection.state import Settings, State
from discrepancy.signals import findings as f
from discrepancy.signals.quantities import quantity
from discrepancy.signals.recording import Array
from discrepancy.signals.units import parse_unit

IMITATED = 1e-5  # share of the energy of a function below which it is imitated: 0.3 % of its size
MOST_TERMS = 3  # of an equation; in the benchmark further terms only followed the noise
MOST_EQUALLY_GOOD = 5  # alternatives that are listed for a term
WIDTHS = np.geomspace(0.125, 4.0, 11)  # multiples of the first width at which a chosen play is tried
WIDTH_FOUND = 0.01  # accuracy of the width, of its natural logarithm: one percent


@dataclass(frozen=True, slots=True)
class FittedTerm:
    """A term as it is reported, with the function that computes it."""

    reported: f.OpenTerm
    function: Function


@dataclass(frozen=True, slots=True)
class OpenEnded:
    """An equation outside the library; without terms: the remaining innovations do not depend on the known signals."""

    terms: tuple[FittedTerm, ...] = ()
    sse_reduction: float = 0.0  # by all terms
    threshold: float = 0.0  # of the reduction by one term
    unconfirmed: bool = False  # whether a further term has the evidence, which held-out data do not confirm
    held_out_sse_reductions: Mapping[str, float] = field(default_factory=dict)  # by channel
    # by fitted parameter: how far it would move with the terms in the fit, and its standard deviation there
    parameter_shifts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def held_out_sse_reduction(self) -> float:
        """The reduction on held-out rows, of all channels."""
        return sum(self.held_out_sse_reductions.values())

    def equation(self) -> str:
        """All terms by place, as text."""
        terms = [term.reported for term in self.terms]
        return "; ".join(
            f"{place} += "
            + " + ".join(
                f"({quantity(t.coefficient, t.unit)}) {t.function}".removesuffix(" 1")
                for t in terms
                if t.place == place
            )
            for place in dict.fromkeys(t.place for t in terms)
        )


def explore(problem: Problem, state: State, settings: Settings) -> OpenEnded:
    """The equation that explains the innovations of a state best; without terms if none passes its gates."""
    simulated = Simulated(problem, state)
    made = candidates(problem, state, simulated)
    noise, fitted = state.noise, state.fit
    whole = np.bincount(noise.row_channel, fitted.residual**2, len(problem.channels))
    blocks = time_blocks_of(noise)
    projector = Projector(problem, noise, fitted)
    white = np.stack([noise.whiten(c.raw) for c in made], axis=1)
    X = projector.off(white)
    size, visible = np.sum(X**2, axis=0), not_imitated(white, X)
    threshold = penalty(1, len(made), settings.alpha)
    chosen: list[int] = []
    equally: list[tuple[str, ...]] = []
    left, reduction, unconfirmed = fitted.residual, 0.0, False
    while len(chosen) < MOST_TERMS:
        free = X - X[:, chosen] @ np.linalg.lstsq(X[:, chosen], X, rcond=None)[0] if chosen else X
        power = np.sum(free**2, axis=0)
        usable = visible & (power > 1e-6 * np.maximum(size, 1e-30))
        with np.errstate(divide="ignore", invalid="ignore"):
            reductions = np.where(usable, (free.T @ left) ** 2 / np.where(usable, power, 1.0), 0.0)
        best = int(np.argmax(reductions))
        inflation = score_variance_inflation(free[:, [best]], left, blocks)
        if reductions[best] / inflation < threshold:
            break
        # Within `same` of the best the likelihoods do not differ: report the simplest of them, which a reader can check best.
        close = np.flatnonzero(reductions > reductions[best] - settings.same).tolist()
        rivals: list[int] = [i for i in close if i not in chosen]
        rivals.sort(key=lambda i: (made[i].function.complexity, -reductions[i]))
        taken = None
        # one that is nearly hidden may fit as well as others and still predict nothing
        for i in rivals[:MOST_EQUALLY_GOOD]:
            fitting = _fitting(simulated, made[i], partial(_reduction, noise, projector, X[:, chosen], left))
            if fitting is not None:
                made[i] = fitting
                white[:, i] = noise.whiten(fitting.raw)
                X[:, i] = projector.off(white[:, [i]])[:, 0]
            confirmed = _held_out(problem, state, white[:, [*chosen, i]], settings)
            shares = np.bincount(noise.row_channel, confirmed, len(problem.channels)) / np.maximum(
                whole, 1e-300
            )
            enough = float(np.sum(confirmed)) >= settings.held_out + reduction * settings.confirmed
            if enough and float(np.max(shares)) >= problem.model.least_explained:
                taken = i
                break
        if taken is None:
            unconfirmed = True
            break
        equally.append(tuple(_place(made[i]) for i in rivals if i != taken))
        chosen.append(taken)
        c = np.linalg.lstsq(X[:, chosen], fitted.residual, rcond=None)[0]
        left = fitted.residual - X[:, chosen] @ c
        reduction = float(np.sum(fitted.residual**2) - np.sum(left**2))
    if not chosen:
        return OpenEnded(threshold=threshold, unconfirmed=unconfirmed)
    confirmed = _held_out(problem, state, white[:, chosen], settings)
    return OpenEnded(
        tuple(_terms(made, chosen, equally, X, fitted.residual)),
        reduction,
        threshold,
        unconfirmed,
        {name: float(np.sum(confirmed[noise.row_channel == i])) for i, name in enumerate(problem.channels)},
        _parameter_shifts(fitted, projector.states.off(white[:, chosen]), X[:, chosen]),
    )


def not_imitated(white: Array, projected: Array) -> NDArray[np.bool_]:
    """Which functions (k,) the fit does not imitate; white: what they do (n, k), projected: what the fit leaves of it."""
    # a function that effects, nuisances or initial states imitate leaves no more than the steps of a port differ from those of the model
    whole = np.maximum(np.sum(white**2, axis=0), 1e-30)
    return np.asarray(np.sum(projected**2, axis=0) > IMITATED * whole, bool)


def _reduction(noise: Noise, projector: Projector, chosen: Array, left: Array, candidate: Candidate) -> float:
    """SSE reduction by a candidate beside the terms chosen so far."""
    free = projector.off(noise.whiten(candidate.raw)[:, None])[:, 0]
    free = free - chosen @ np.linalg.lstsq(chosen, free, rcond=None)[0]
    return float(free @ left) ** 2 / max(float(free @ free), 1e-300)


def _fitting(
    simulated: Simulated, candidate: Candidate, reduction: Callable[[Candidate], float]
) -> Candidate | None:
    """A play at the width with the largest SSE reduction; None for functions without a width."""
    wide = candidate.function.wide
    if wide is None:
        return None

    def at(width: float) -> Candidate | None:
        shape = simulated.shape(wide.having(width))
        return None if shape is None else simulated.at(candidate.place, shape)

    def loss(log_width: float) -> float:
        made = at(float(np.exp(log_width)))
        return 0.0 if made is None else -reduction(made)

    middle = float(np.log(wide.width))
    grid = middle + np.log(WIDTHS)
    # a coarse grid first: the reduction has several maxima over the width, and the bounded search finds only a local one
    best = int(np.argmin([loss(w) for w in grid]))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    found = minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": WIDTH_FOUND})
    fitted = at(float(np.exp(found.x)))
    return fitted if fitted is not None and reduction(fitted) > reduction(candidate) else None


def _parameter_shifts(fitted: Fit, terms: Array, projected: Array) -> dict[str, tuple[float, float]]:
    """By fitted parameter: its shift when the terms enter the fit (minus the omitted-variable bias), and its standard deviation then."""
    c = np.linalg.lstsq(projected, fitted.residual, rcond=None)[0]
    J = fitted.columns
    moved = -fitted.covariance @ (J.T @ (terms @ c))
    Q = np.linalg.qr(terms)[0]
    left = np.sqrt(np.diag(inverse(fitted.information - (J.T @ Q) @ (Q.T @ J), fitted.information)))
    return {n: (float(m), float(s)) for n, m, s in zip(fitted.names, moved, left, strict=True)}


def _place(candidate: Candidate) -> str:
    return f"{candidate.place} += {candidate.function.text}"


def _terms(
    candidates: Sequence[Candidate],
    chosen: Sequence[int],
    equally: Sequence[tuple[str, ...]],
    X: Array,
    e: Array,
) -> list[FittedTerm]:
    gram = X[:, chosen].T @ X[:, chosen]
    covariance = inverse(gram)
    coefficient = covariance @ (X[:, chosen].T @ e)
    found = []
    for k, i in enumerate(chosen):
        made, size = candidates[i], float(coefficient[k] * candidates[i].amplitude)
        sd = float(np.sqrt(covariance[k, k]) * made.amplitude)
        reported = f.OpenTerm(
            place=made.place,
            function=made.function.text,
            coefficient=size,
            low=size - 1.96 * sd,
            high=size + 1.96 * sd,
            unit=str(parse_unit(made.unit) / made.function.unit),
            equally_good=list(equally[k][:MOST_EQUALLY_GOOD]),
        )
        found.append(FittedTerm(reported, made.function))
    return found


def _held_out(problem: Problem, state: State, white: Array, settings: Settings) -> Array:
    """Reduction of the squared error (n,) on rows that coefficients and nuisances were not fitted to; both enter linearly."""
    noise, fitted, reduction = state.noise, state.fit, np.zeros(state.noise.keep.size)
    base = problem.predict(fitted.values)
    e = noise.whiten(problem.measured - base)
    local = noise.whiten(differences(problem, fitted.values, base, problem.local_names))
    for test in folds(problem, noise, settings.folds):
        train_states = WindowStates(local, noise.row_window, ~test)
        test_states = WindowStates(local, noise.row_window, test)
        J, A, b = fitted.columns[~test], train_states.off(white)[~test], train_states.off(e)[~test]
        prior = fitted.information - fitted.columns.T @ fitted.columns
        H = np.block([[J.T @ J + prior, J.T @ A], [A.T @ J, A.T @ A]])
        c = inverse(H) @ np.concatenate([J.T @ b, A.T @ b])
        with_terms = test_states.off(e - fitted.columns @ c[: J.shape[1]] - white @ c[J.shape[1] :])
        alone = inverse(J.T @ J + prior) @ (J.T @ b)
        without = test_states.off(e - fitted.columns @ alone)
        reduction[test] = without[test] ** 2 - with_terms[test] ** 2
    return reduction


def extended(model: Model, found: OpenEnded) -> Model:
    """The model with the equation at its ports, in every later simulation."""
    inner, places = model.simulate, {port.name for port in model.ports}
    acting = [t for t in found.terms if t.reported.place in places]

    def simulate(
        window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        # the terms are functions of the outputs without them, as in the search: correct to first order in the terms
        true = {**window.known, **inner(window, values, extra)}
        added = {name: extra.get(name, np.zeros(window.time_s.size)) for name in places}
        for t in acting:
            place, size = t.reported.place, t.reported.coefficient
            added[place] = added[place] + size * t.function.of(true, window.step_s)
        return inner(window, values, added)

    return replace(model, simulate=simulate)
