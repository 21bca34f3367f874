"""Checks whether several recordings agree on the size of an effect, and reports where machine, day or load were not the same.

One-way analysis of variance over recordings. The observations are the sizes that single windows would have, to first order about the fit.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as f_dist

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem
from discrepancy.selection.state import State
from discrepancy.signals.quantities import figures, quantity
from discrepancy.signals.recording import Array

SHOWN = 3  # recordings; of more, only the smallest and the largest size are printed


def disagreements(problem: Problem, state: State, effects: Sequence[str]) -> list[str]:
    """A sentence for each of these effects on whose size the recordings do not agree; effects with one amplitude parameter only."""
    owner = np.array([w.recording for w in problem.windows])
    names = list(dict.fromkeys(owner.tolist()))
    found = []
    for effect in [problem.model.effect(name) for name in effects if name in state.accepted]:
        own = effect.amplitude_parameters
        if len(names) < 2 or len(own) != 1 or own[0].discrete:
            continue
        size = state.fit.values.shared[own[0].name]
        change, weight = _by_window(problem, state, own[0].name)
        groups = [owner == name for name in names]
        changes = _changes_of_groups(change, weight, groups)
        if changes is None or np.ptp(changes) < gates.RECORDINGS_APART.threshold * abs(size - own[0].value):
            continue
        # to first order a size may pass the bounds that a fit would keep to
        sizes = dict(zip(names, np.clip(size + changes, own[0].lower, own[0].upper).tolist(), strict=True))
        ends = [min(sizes, key=lambda n: sizes[n]), max(sizes, key=lambda n: sizes[n])]
        shown = names if len(names) <= SHOWN else ends
        each = ", ".join(f"{quantity(sizes[name], own[0].unit)} in {name}" for name in shown)
        found.append(
            f"the recordings do not agree on {own[0].name} (all together {figures(size)}): {each}; `--each` diagnoses each recording alone"
        )
    return found


def _by_window(problem: Problem, state: State, name: str) -> tuple[Array, Array]:
    """Change of a fitted parameter that each window alone would make (windows,), and its weight: the inverse variance, 0 without information."""
    x, windows = _beyond_others(state.fit, name), state.noise.row_window
    count = len(problem.windows)
    weight = np.asarray(np.bincount(windows, x**2, count), float)
    pull = np.bincount(windows, x * state.fit.residual, count)
    return np.divide(pull, weight, out=np.zeros(count), where=weight > 0.0), weight


def _beyond_others(fitted: Fit, name: str) -> Array:
    """Column of a parameter (n,) with all other fitted parameters projected out, within their priors."""
    at = fitted.names.index(name)
    others = [i for i in range(len(fitted.names)) if i != at]
    if not others:
        return fitted.columns[:, at]
    shares = inverse(fitted.information[np.ix_(others, others)]) @ fitted.information[others, at]
    return np.asarray(fitted.columns[:, at] - fitted.columns[:, others] @ shares, float)


def _changes_of_groups(change: Array, weight: Array, groups: Sequence[Array]) -> Array | None:
    """Mean change of each group (g,) if the groups differ by more than their own scatter explains; None if not, or without enough windows."""
    whole = np.array([float(np.sum(weight[g])) for g in groups])
    free = sum(int(np.count_nonzero(weight[g] > 0.0)) - 1 for g in groups)
    if np.any(whole == 0.0) or free < 1:
        return None
    means = np.array([float(weight[g] @ change[g]) for g in groups]) / whole
    within = sum(
        float(weight[g] @ (change[g] - mean) ** 2) for g, mean in zip(groups, means.tolist(), strict=True)
    )
    middle = float(whole @ means) / float(np.sum(whole))
    between = float(whole @ (means - middle) ** 2)
    # whitened rows have variance 1: a scatter below that is chance, and would make the test too sharp
    ratio = between / (len(groups) - 1) / max(within / free, 1.0)
    return means if f_dist.sf(ratio, len(groups) - 1, free) < gates.RECORDINGS_AGREE.threshold else None
