"""Loads of the straight machine on an incline as the thesis prints them, for a comparison with `ecu.estimators.loads.normal_force`.

Standing (47)-(52), accelerating (53)-(59) and banked (65)-(69) are right as printed but for letters: r is rear in (54) and right in (66),
and the balance of (65) is headed as one about y.
"""

import math

from ecu.estimators.compiled import compiled


@compiled
def inclined_printed(
    mass_weight: float, front: float, rear: float, grade: float, height: float
) -> tuple[float, float]:
    """Force on each front and each rear wheel by (64) as printed: each axle by its own distance (E-13).

    mass_weight m g [N]; distances of the CoG to front and rear axle [m]; grade [rad], uphill +; height of the CoG [m].
    """
    half, base = mass_weight / 2.0, front + rear
    c, s = math.cos(grade), math.sin(grade)
    return half * (front * c - height * s) / base, half * (rear * c + height * s) / base
