"""Centre of gravity of the front unit and of the whole machine as the thesis prints them (36)-(42)."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Arm, Body, Bucket
from ecu.estimators.quantities import Centre


@compiled
def front_unit_printed(lift_arm_angle: float, payload: float, frame: Body, arm: Arm, bucket: Bucket) -> Body:
    """Lump of the front unit by (37), (38), (42) as printed: only the level arm turns, about the
    front frame's CoG, and the payload rises with the bucket's lever (E-11, E-12). The inertias are 0.
    """
    bucket_mass = arm.mass + bucket.mass
    level_x = arm.pivot_x + arm.length
    arm_x, arm_z = arm.pivot_x + arm.along, arm.pivot_z + arm.above
    x_bucket = (arm.mass * arm_x + bucket.mass * (level_x + bucket.forward)) / bucket_mass
    z_bucket = (arm.mass * arm_z + bucket.mass * (arm.pivot_z + bucket.above)) / bucket_mass
    x_load = level_x + bucket.payload_forward
    z_load = arm.pivot_z + bucket.payload_above
    c, s = math.cos(lift_arm_angle), math.sin(lift_arm_angle)
    lever = x_bucket - frame.x
    both = bucket_mass + payload
    x = (bucket_mass * (frame.x + lever * c) + payload * (frame.x + (x_load - frame.x) * c)) / both
    z = (bucket_mass * (z_bucket + lever * s) + payload * (z_load + lever * s)) / both
    mass = frame.mass + both
    return Body(
        mass,
        (frame.mass * frame.x + both * x) / mass,
        (frame.mass * frame.z + both * z) / mass,
        0.0,
        0.0,
        0.0,
    )


@compiled
def machine_centre_repaired(articulation_angle: float, front: Body, rear: Body) -> Centre:
    """(36), (40), (41) with the two repairs without which nothing comes out: the sign (E-09) and y of the rear body (E-10)."""
    mass = front.mass + rear.mass
    x = (front.mass * front.x * math.cos(articulation_angle) + rear.mass * rear.x) / mass
    y = front.mass * front.x * math.sin(articulation_angle) / mass
    z = (front.mass * front.z + rear.mass * rear.z) / mass
    return Centre(mass, x, y, z)


@compiled
def machine_centre_printed(articulation_angle: float, front: Body, rear: Body) -> Centre:
    """(36), (40), (41) as printed, mapped to y left: (40) adds the rear body's *longitudinal* moment
    to the lateral one (E-10)."""
    centre = machine_centre_repaired(articulation_angle, front, rear)
    return Centre(centre.mass, centre.x, centre.y - rear.mass * rear.x / centre.mass, centre.z)
