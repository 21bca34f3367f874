"""Causes of false roll-over alarms: information that the ECU lacked, or a wrong prediction."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.compose import lockstep
from hil.judgement import first_warning
from plant.physics.surface import Surface
from studies.campaigns.batch import Result, markdown_table
from studies.campaigns.memory import columns_of
from studies.campaigns.roll_over import Case, scenario_of

Array = NDArray[np.float64]
SLIDING = 0.9
"""An axle that pushes with more than this share of what the ground gives slides."""

UNKNOWN = "slippery ground, before an axle slides: the ECU has no information"
SLIDES = "slippery ground, while it slides: it would tip where the ground is dry again"
FORESEEN = "dry ground: foreseen closer than it came"
CAUSES = (UNKNOWN, SLIDES, FORESEEN)


def explain(case: Case) -> Result:
    """What a turn with a false alarm shows.

    margin: smallest load of a wheel over its standing load; grip: largest force of an axle on the ground over its load
    up to the warning, as a share of what the ground gives; slippery: whether that is less than on a dry road.
    """
    # without limits, as in the run with the alarm: they would change what is to be explained
    drive = lockstep(scenario_of(case), limits=False, reference=False).run()
    standing = drive.truth[0].normal_force
    warned = first_warning(columns_of(drive.bus)) or 0.0
    before = [moment for moment in drive.truth if moment.time_s <= warned]
    pushes = [axles(m.longitudinal_force, m.lateral_force, m.normal_force) for m in before]
    return {
        "margin": float(min((moment.normal_force / standing).min() for moment in drive.truth)),
        "grip": float(np.max(pushes)) / case.ground.friction,
        "slippery": case.ground.friction < Surface().friction,
    }


def axles(along: Array, across: Array, normal: Array) -> Array:
    """Force on the ground over load of the front and of the rear axle, (2,); from forces of the four wheels, (4,) [N]."""
    x, y, z = (force.reshape(2, 2).sum(axis=1) for force in (along, across, normal))
    # by axle and not by wheel: the inner wheel of a turn slides early and pushes little
    return np.asarray(np.hypot(x, y) / z, float)


def cause(found: Result) -> str:
    """What the ECU was wrong about."""
    # on dry ground the ECU knows the friction, so that only its prediction can be wrong
    if not found["slippery"]:
        return FORESEEN
    return SLIDES if found["grip"] > SLIDING else UNKNOWN


def by_cause(found: Sequence[Result]) -> str:
    """A row per cause: how many, what load the lightest wheel kept, and how much of the grip had been used when the warning came."""
    rows = []
    for name in CAUSES:
        these = [one for one in found if cause(one) == name]
        rows.append(
            (name, str(len(these)), *(percents([one[key] for one in these]) for key in ("margin", "grip")))
        )
    return markdown_table(
        ("least, median, most of", "turns", "least load kept", "grip used by the time of the warning"), rows
    )


def percents(shares: Sequence[float]) -> str:
    """Least, median and most."""
    if not shares:
        return "–"
    return ", ".join(f"{100 * share:.0f}" for share in (min(shares), np.median(shares), max(shares))) + " %"
