"""Parameters that the data do not determine, and the test on a rig or in the field that would determine them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.estimation.normal_equations import inverse
from identify.ends import NORMAL_95
from identify.tyre.estimate import Estimate, Problem

STEPS: Mapping[str, str] = {
    "PCX1": "drive to slips beyond 2 and brake to lock: the shape shows far behind the peak",
    "PDX1": "drive or brake over the peak of the force at nominal load",
    "PDX2": "drive and brake over the peak at a second load, at least a quarter higher",
    "PEX1": "pass the peak slowly (30 s), so that its roundness is sampled",
    "PEX2": "pass the peak slowly at a second load",
    "PEX3": "pass the peak at three loads or more",
    "PEX4": "both drive and brake over the peak",
    "PKX1": "ramp from free rolling to 5 % slip within 20 s, driving and braking",
    "PKX2": "slow ramps to 5 % slip at three loads or more, over a factor of 1.5",
    "PKX3": "slow ramps to 5 % slip at a second load, at least a quarter higher",
    "PPX1": "slow ramps to 5 % slip at a second inflation pressure",
    "PPX2": "slow ramps to 5 % slip at three inflation pressures",
    "PPX3": "drive over the peak at a second inflation pressure",
    "PPX4": "drive over the peak at three inflation pressures",
    "PHX1": "measure the wheel's speed and radius by themselves: a scale factor from the run hides a shift of slip",
    "PHX2": "the same at a second load",
    "PVX1": "zero the force with the wheel lifted off: the zero of each run hides a shift of force",
    "PVX2": "the same at a second load",
    "PCFX3": "steps of the cylinder's speed at small slip at a second inflation pressure",
    "RBX1": "hold slips of 2 to 15 % with the wheel at slip angles of 4 and 8°, to both sides",
    "RBX2": "hold slips of 15 to 40 % with the wheel at slip angles of 4 and 8°, to both sides",
    "RCX1": "hold slips of 2 to 15 % with the wheel at a slip angle of 10° or more",
    "REX1": "hold slips of 2 to 15 % with the wheel at three slip angles up to 10° or more",
    "carcass stiffness": "steps of the cylinder's speed at slips below 3 %, at two speeds with a ratio of 3",
    "relaxation length": "steps of the cylinder's speed at slips below 3 %, at two speeds with a ratio of 3",
}
DEFINED = 1.0
"""Half width of a 95 % interval over the change that matters, above which a parameter counts as not determined."""
TOGETHER = 0.98
"""Correlation beyond which two parameters are named as a pair."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Open:
    """A parameter that the data do not determine."""

    name: str
    reason: str
    step: str  # the test that would determine it


def undetermined(found: Estimate, problem: Problem) -> list[Open]:
    """Parameters with a wide interval, at a bound, or without influence on the data."""
    typical = {u.name: u.typical for u in problem.unknowns}
    covariance = found.covariance
    linear = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(linear, linear)
    sd = np.array([found.interval(n).sd for n in found.names])
    out = []
    for i, name in enumerate(found.names):
        if name not in STEPS:
            continue
        half = NORMAL_95 * sd[i] / typical[name]
        if linear[i] < 1e-140:
            reason = "the data do not depend on it"
        elif name in found.at_bound:
            reason = f"it ends at its bound ({found.values[name]:.4g})"
        elif half > DEFINED:
            partners = [
                n
                for j, n in enumerate(found.names)
                if j != i and abs(correlation[i, j]) > TOGETHER and n in STEPS
            ]
            pair = f"; only with {' and '.join(partners)} together" if partners else ""
            reason = f"its 95 % interval is {found.values[name]:.3g} ± {NORMAL_95 * sd[i]:.2g}{pair}"
        else:
            continue
        out.append(Open(name=name, reason=reason, step=STEPS[name]))
    return out


def not_fitted(fitted: Sequence[str], wanted: Sequence[str]) -> list[Open]:
    """Parameters that were not fitted, because no run depends on them."""
    return [
        Open(name=name, reason="no run depends on it by itself", step=STEPS[name])
        for name in wanted
        if name not in fitted
    ]


def dominated(found: Estimate, name: str) -> dict[str, float]:
    """Share of a parameter's variance that each calibration causes: the gain of a better certificate."""
    i = found.names.index(name)
    full = found.covariance[i, i]
    shares: dict[str, float] = {}
    for other in ("gain", "load 0", "load 1"):
        if other in found.names:
            j = found.names.index(other)
            # the variance if this nuisance were known exactly: a very large information on it
            known = found.information.copy()
            known[j, j] += 1e12 * max(known[j, j], 1.0)
            shares[other] = float(1.0 - inverse(known)[i, i] / full) if full > 0.0 else 0.0
    return shares
