"""A pile that the bucket is driven into."""

import math

from plant.compiled import compiled
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import in_world, push
from plant.state import BUCKET
from plant.workspace import Workspace

STIFFNESS = 2.0e6  # of the packed pile before it gives way [N/m]
FLOW = 0.005  # time in which it gives way [s]


@compiled
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Resistance at the bucket's edge: elastic, then giving way at a force that grows with the depth dug."""
    pin, axes = work.places.points[3], work.places.axes[4]
    px, py, pz = pin[0], pin[1], pin[2]
    px += q[4] * axes[0, 0] + q[5] * axes[0, 2]
    py += q[4] * axes[1, 0] + q[5] * axes[1, 2]
    pz += q[4] * axes[2, 0] + q[5] * axes[2, 2]
    ahead, _, _ = in_world(state, work, px, py, pz)
    face = q[0] + state[x]
    force = max(STIFFNESS * (ahead - face), 0.0)
    holds = q[1] * (1.0 - math.exp(-state[x] / q[2]))
    work.rate[x] = max(force - holds, 0.0) / (STIFFNESS * FLOW)
    world = work.places.world
    along, down = -force, -q[3] * force
    push(
        work,
        BUCKET,
        px,
        py,
        pz,
        along * world[0, 0] + down * world[2, 0],
        along * world[0, 1] + down * world[2, 1],
        along * world[0, 2] + down * world[2, 2],
    )


EFFECT = Effect(
    name="pile_entry",
    sentence="The bucket pushes into a pile.",
    equation="F <= F_max (1 - exp(-s/s0)), F_z = -c F",
    parameters=(
        Parameter("distance_m", "m", 10.0, -1e3, 1e3, "where the pile begins, along the world's x axis"),
        Parameter("most_N", "N", 60e3, 0.0, 300e3, "F_max: 20 to 100 kN"),
        Parameter("depth_m", "m", 0.5, 0.01, 10.0, "s0: depth at which it resists with 63 per cent of that"),
        Parameter(
            "weight_share",
            "1",
            0.5,
            -1.0,
            2.0,
            "c: load on the bucket over the resistance; negative when it digs itself up",
        ),
        Parameter("edge_x_m", "m", 0.82, -1.0, 3.0, "cutting edge ahead of the pin, as carried"),
        Parameter("edge_z_m", "m", 0.88, -1.0, 3.0, "and above it"),
    ),
    acts_on="lift and tilt pressure, all normal forces, longitudinal force",
    signature="Both pressures jump while the speed falls to zero under torque; the front loads change.",
    excited_by="digging",
    confusable=(Confusable("payload_mass", "a payload shows at standstill away from the pile"),),
    source="elastic-plastic penetration",
    own_states=1,
)
