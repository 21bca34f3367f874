"""Whether several recordings agree on the size of an effect: machines, days or loads that were not the same are reported.

One-way analysis of variance of the sizes that windows would have by themselves, to first order about the fit: between recordings over within them.
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

SHOWN = 3  # recordings, beyond which only the smallest and the largest size are printed


def disagreements(problem: Problem, state: State, effects: Sequence[str]) -> list[str]:
    """A sentence for each of these effects with one size on which the recordings do not agree."""
    owner = np.array([w.recording for w in problem.windows])
    names = list(dict.fromkeys(owner.tolist()))
    found = []
    for effect in [problem.model.effect(name) for name in effects if name in state.accepted]:
        own = effect.amplitude_parameters
        if len(names) < 2 or len(own) != 1 or own[0].discrete:
            continue
        size = state.fit.values.shared[own[0].name]
        away, weight = _by_window(problem, state, own[0].name)
        groups = [owner == name for name in names]
        parted = _parted(away, weight, groups)
        if parted is None or np.ptp(parted) < gates.RECORDINGS_APART.threshold * abs(size - own[0].value):
            continue
        sizes = dict(zip(names, (size + parted).tolist(), strict=True))
        ends = [min(sizes, key=lambda n: sizes[n]), max(sizes, key=lambda n: sizes[n])]
        shown = names if len(names) <= SHOWN else ends
        each = ", ".join(f"{quantity(sizes[name], own[0].unit)} in {name}" for name in shown)
        found.append(
            f"the recordings do not agree on {own[0].name}, {figures(size)} in all: {each}; `--each` judges every one by itself"
        )
    return found


def _by_window(problem: Problem, state: State, name: str) -> tuple[Array, Array]:
    """What every window would change of a fitted parameter, and the weight of that: the inverse of its variance; 0 where it tells nothing."""
    x, windows = _beyond_others(state.fit, name), state.noise.row_window
    count = len(problem.windows)
    weight = np.asarray(np.bincount(windows, x**2, count), float)
    pull = np.bincount(windows, x * state.fit.residual, count)
    return np.divide(pull, weight, out=np.zeros(count), where=weight > 0.0), weight


def _beyond_others(fitted: Fit, name: str) -> Array:
    """Column of a parameter (n,) beyond what the others can do, as far as their priors let them."""
    at = fitted.names.index(name)
    others = [i for i in range(len(fitted.names)) if i != at]
    if not others:
        return fitted.columns[:, at]
    shares = inverse(fitted.information[np.ix_(others, others)]) @ fitted.information[others, at]
    return np.asarray(fitted.columns[:, at] - fitted.columns[:, others] @ shares, float)


def _parted(away: Array, weight: Array, groups: Sequence[Array]) -> Array | None:
    """Change of each group (g,), where they differ beyond what is usual within them; None where they do not or nobody can tell."""
    whole = np.array([float(np.sum(weight[g])) for g in groups])
    free = sum(int(np.count_nonzero(weight[g] > 0.0)) - 1 for g in groups)
    if np.any(whole == 0.0) or free < 1:
        return None
    means = np.array([float(weight[g] @ away[g]) for g in groups]) / whole
    within = sum(
        float(weight[g] @ (away[g] - mean) ** 2) for g, mean in zip(groups, means.tolist(), strict=True)
    )
    middle = float(whole @ means) / float(np.sum(whole))
    between = float(whole @ (means - middle) ** 2)
    ratio = between / (len(groups) - 1) / max(within / free, 1.0)
    return means if f_dist.sf(ratio, len(groups) - 1, free) < gates.RECORDINGS_AGREE.threshold else None
