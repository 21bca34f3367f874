"""Where a prediction starts: what no machine can feel is cut to what one can.

Angular accelerations are differences of a gyro's samples. Samples that contradict one another give tens of g a metre away from the
sensor. Taken as the ground's slope they turn with the machine for the whole horizon, and the prediction runs away: speeds of 100 m/s,
forces of 1e20 N. ISO 8855, rear frame axes.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import GRAVITY
from ecu.estimators.quantities import Vector

MOST = 2.0 * GRAVITY
"""Largest specific force, and largest acceleration, that a prediction starts from [m/s2]. Weight and tyres at their grip give 1.3 g
together; the rest is for a bump."""
WEIGHTS, WEIGHTS_RATE = 2.0, 20.0
"""How far the load of a wheel or of the rear axle may be from the quasi-static one, and how fast that may change, in weights of the
machine [-, 1/s]. In 40 random drives over kerbs and drops of up to 20 cm they were 1.3 and 9.7 at most."""


@compiled
def felt(force: Vector) -> Vector:
    """The specific force [m/s2] in its direction, no larger than `MOST`."""
    size = math.sqrt(force.x * force.x + force.y * force.y + force.z * force.z)
    if size <= MOST:
        return force
    share = MOST / size
    return Vector(share * force.x, share * force.y, share * force.z)


@compiled
def within(value: float, most: float) -> float:
    """The value, no further from 0 than `most`."""
    return min(max(value, -most), most)
