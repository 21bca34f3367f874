"""Faults of sensors that a right model would allow, and a wrong one does not: far below what matters, or readings that come early.

Long recordings make any difference significant, and a law that is slightly wrong leaves many of a small size. A little of a motion looks like a scale of its
reading, and a little of its rate like a delay. A delay below zero shifts the whole motion ahead, as a faster law of the model would.
"""

from collections.abc import Sequence
from dataclasses import replace

from discrepancy import gates
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.signals import findings as f
from discrepancy.signals.adequacy import ChannelAdequacy, inadequate
from discrepancy.signals.quantities import quantity


def of_a_wrong_model(
    problem: Problem, found: Sequence[f.Finding], channels: Sequence[ChannelAdequacy], equation: OpenEnded
) -> list[f.Finding]:
    """The findings, with such faults as proxies where the model is known to be wrong: by errors over budget, an equation, or a proxy."""
    if not (inadequate([*channels]) or equation.terms or any(not x.named for x in found)):
        return [*found]
    doubted = []
    for x in found:
        effect = problem.model.effect(x.effect)
        fault = x.named and effect.kind == "sensor"
        caveats = [*too_small_to_matter(effect, x), *early(effect, x)] if fault else []
        doubted.append(replace(x, named=False, caveats=caveats) if caveats else x)
    return doubted


def too_small_to_matter(effect: Effect, found: f.Finding) -> list[str]:
    """A caveat of a sensor's fault far below the smallest change that matters: so small an error is within the sensor's sheet."""
    estimates = {e.name: e for e in found.parameters}
    sizes = [
        (max(abs(end - p.value) for end in (e.value, e.low, e.high) if end is not None) / abs(p.typical), p)
        for p in effect.amplitude_parameters
        if (e := estimates.get(p.name)) is not None
    ]
    share, p = max(sizes, key=lambda size: size[0], default=(1.0, effect.parameters[0]))
    if effect.is_profile or share >= gates.MATTERS_IN_A_WRONG_MODEL.threshold:
        return []
    matters = quantity(abs(p.typical), p.unit)
    return [
        f"is at most {share:.1%} of the change of {p.name} that matters, {matters}, in a model that is wrong in other ways"
    ]


def early(effect: Effect, found: f.Finding) -> list[str]:
    """A caveat of a reading that comes early: no sensor reads ahead."""
    first = found.parameters[0]
    if not first.name.endswith(".delay") or first.value >= 0.0:
        return []
    reading = effect.reading or first.name.removesuffix(".delay")
    return [
        f"{reading} comes early by {quantity(-first.value, first.unit)}, which no sensor does: its stamps may be wrong, or the model, which is wrong in other ways, answers too late"
    ]
