"""Names whose size hangs on a best proxy: without it, they would be something else.

The cause that a proxy stands in for is unknown, and so is what it leaves to the effects beside it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy import gates
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Parameter
from discrepancy.signals import findings as f
from discrepancy.signals.quantities import figures, quantity
from discrepancy.signals.recording import Array


def hanging_on_proxies(problem: Problem, fitted: Fit, found: Sequence[f.Finding]) -> list[f.Finding]:
    """The findings; a name whose size would change by more than itself without the proxies is one, too. fitted: with all accepted effects."""
    effects = [problem.model.effect(x.effect) for x in found]
    # a rival that leads its group was fitted in the place of what was accepted
    fits = [set(e.amplitude_names) <= set(fitted.names) for e in effects]
    proxies = [e for e, x, fit in zip(effects, found, fits, strict=True) if fit and not x.named]
    if not proxies:
        return list(found)
    said = f"hangs on {' and '.join(e.name for e in proxies)}, of which the cause is unknown: without {'it' if len(proxies) == 1 else 'them'}"
    changed = []
    for effect, x, fit in zip(effects, found, fits, strict=True):
        moved = _moved(fitted, effect, proxies) if x.named and fit else None
        if moved is not None:
            p, alone = moved
            now = figures(fitted.values.shared[p.name])
            text = f"{said}, its {p.name} would be {quantity(alone, p.unit)} instead of {now}"
            changed.append(replace(x, named=False, caveats=[text]))
        else:
            changed.append(x)
    return changed


def _moved(fitted: Fit, effect: Effect, proxies: Sequence[Effect]) -> tuple[Parameter, float] | None:
    """The effect's amplitude that moves most without the proxies, and its value there, to first order; None where all move by less than the effect's size."""
    own, other = effect.amplitude_parameters, [p for e in proxies for p in e.amplitude_parameters]
    typical = np.array([p.typical for p in own])
    size = _size(fitted, own) / typical
    i, j = ([fitted.names.index(p.name) for p in some] for some in (own, other))
    covariance = fitted.covariance
    back = np.linalg.lstsq(covariance[np.ix_(j, j)], -_size(fitted, other), rcond=None)[0]
    moved = covariance[np.ix_(i, j)] @ back / typical
    if np.linalg.norm(moved) <= gates.HANGS_ON_A_PROXY.threshold * np.linalg.norm(size):
        return None
    most = int(np.argmax(np.abs(moved)))
    return own[most], own[most].value + float((size + moved)[most] * typical[most])


def _size(fitted: Fit, parameters: Sequence[Parameter]) -> Array:
    """Distances from the baseline (k,)."""
    return np.array([fitted.values.shared[p.name] - p.value for p in parameters])
