"""Why a false alarm was given: what the ECU could not know, what it reckons otherwise, and what it foresaw wrongly."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.campaign.batch import Result, markdown_table
from hil.campaign.memory import columns_of
from hil.campaign.roll_over import Case, scenario_of
from hil.compose import lockstep, machine_of
from hil.judgement import first_warning
from hil.verdict import JUSTIFIED_MARGIN
from plant.plant import Plant
from plant.surface import Surface

Array = NDArray[np.float64]
SLIDING = 0.9
"""An axle that pushes with more than this share of what the ground gives slides."""

LIGHT = f"a wheel that the slope has made light: below {100 * JUSTIFIED_MARGIN:.0f} % of its load on the level, from which the ECU reckons"
UNKNOWN = "slippery ground, before an axle slides: nothing tells the ECU"
SLIDES = "slippery ground, while it slides: it would tip where the ground is dry again"
FORESEEN = "foreseen wrongly"
CAUSES = (LIGHT, UNKNOWN, SLIDES, FORESEEN)


def explain(case: Case) -> Result:
    """What a turn with a false alarm shows.

    level_margin: smallest load over that of standing level; grip: largest force of an axle on the ground over its
    load up to the warning, as a share of what the ground gives; slippery: whether that is less than on a dry road.
    """
    scenario, load = scenario_of(case), case.load
    drive = lockstep(scenario, limits=False, reference=False).run()
    machine, arm = machine_of(scenario), scenario.start.lift_arm_angle
    level = Plant(machine, payload_mass=load.payload_kg, lift_arm_angle=arm).truth().normal_force
    warned = first_warning(columns_of(drive.bus)) or 0.0
    before = [moment for moment in drive.truth if moment.time_s <= warned]
    pushes = [axles(m.longitudinal_force, m.lateral_force, m.normal_force) for m in before]
    return {
        "level_margin": float(min((moment.normal_force / level).min() for moment in drive.truth)),
        "grip": float(np.max(pushes)) / case.ground.friction,
        "slippery": case.ground.friction < Surface().friction,
    }


def axles(along: Array, across: Array, normal: Array) -> Array:
    """Force on the ground over load of the front and of the rear axle, (2,); from forces of the four wheels, (4,) [N]."""
    x, y, z = (force.reshape(2, 2).sum(axis=1) for force in (along, across, normal))
    return np.asarray(np.hypot(x, y) / z, float)


def cause(found: Result) -> str:
    """The first cause that fits."""
    if found["level_margin"] < JUSTIFIED_MARGIN:
        return LIGHT
    if not found["slippery"]:
        return FORESEEN
    return SLIDES if found["grip"] > SLIDING else UNKNOWN


def by_cause(found: Sequence[Result]) -> str:
    """A row per cause: how many, and which share of the ground's grip had been used when the warning came."""
    rows = []
    for name in CAUSES:
        grips = [one["grip"] for one in found if cause(one) == name]
        used = (
            (f"{100 * share:.0f}" for share in (min(grips), np.median(grips), max(grips))) if grips else "–"
        )
        rows.append((name, str(len(grips)), ", ".join(used) + (" %" if grips else "")))
    return markdown_table(("cause", "turns", "grip used by then: least, median, most"), rows)
