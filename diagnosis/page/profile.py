"""Draws an effect of many parameters, such as a road's profile: its values in their order, with their intervals."""

from collections.abc import Sequence

import numpy as np

from diagnosis.page.figure import figure
from discrepancy.signals.findings import Estimate
from discrepancy.signals.quantities import figures, quantity
from discrepancy.signals.units import shown
from report.kit.axis import Axis, around, number
from report.kit.plot import Curve

FEWEST = 5  # values; fewer are listed as text


def profile(values: Sequence[Estimate]) -> str:
    """A plot over the number of the parameter; empty for an effect of few."""
    if len(values) < FEWEST:
        return ""
    at = np.arange(1.0, len(values) + 1.0)
    ends = [np.array([e.value if end is None else end for e, end in zip(values, given, strict=True)])
            for given in ([e.low for e in values], [e.high for e in values])]  # fmt: skip
    found = np.array([e.value for e in values])
    curves = [
        Curve("95 % interval", at, ends[0], "limit"),
        Curve("95 % interval", at, ends[1], "limit", silent=True),
        Curve("found", at, found, "estimate"),
    ]
    across, upward = Axis(1.0, float(len(values))), around((c.value for c in curves), (0.0,))
    labels = ([(t, number(t)) for t in across.ticks(8)], [(t, number(t)) for t in upward.ticks(5)])
    first, last, unit = values[0].name, values[-1].name, shown(values[0].unit)
    return figure(
        f"{first} to {last} [{unit}]" if unit else f"{first} to {last}",
        curves,
        across,
        upward,
        labels,
        "number of the value",
        f"{len(values)} values from {figures(float(found.min()))} to {quantity(float(found.max()), values[0].unit)}",
        0.0,
    )
