"""A pile that the bucket is driven into."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import in_world, push
from plant.physics.state import BUCKET
from plant.physics.workspace import Workspace

STIFFNESS = 2.0e6  # of the packed pile, where the edge comes back from its deepest place [N/m]
LOSS = 1.0  # of the packed pile: by how much less it pushes back per speed at which the edge leaves it [s/m]
FOLLOWS = 10e-3  # time within which the remembered depth follows the edge [s]: two of the longest steps


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Resistance at the bucket's edge: what the depth bears while it digs, the packed pile's spring where it comes back; what was dug weighs.

    The force is a continuous function of the edge's place and of the deepest one so far (state[x]), so it does not depend on where
    within a step of the integration the edge meets the pile. A depth that had to be driven ahead by a stiff force would.
    """
    pin, axes = work.places.points[3], work.places.axes[4]
    px, py, pz = pin[0], pin[1], pin[2]
    px += q[4] * axes[0, 0] + q[5] * axes[0, 2]
    py += q[4] * axes[1, 0] + q[5] * axes[1, 2]
    pz += q[4] * axes[2, 0] + q[5] * axes[2, 2]
    edge, _, _ = in_world(state, work, px, py, pz)
    depth = edge - q[0]
    deepest, r = max(state[x], depth, 0.0), work.places.world
    borne = q[1] * (1.0 - math.exp(-deepest / q[2]))
    work.rate[x] = (deepest - state[x]) / FOLLOWS
    m = work.tree.motion[BUCKET]
    speed = r[0, 0] * (m[3] + m[1] * pz - m[2] * py)
    speed += r[0, 1] * (m[4] + m[2] * px - m[0] * pz) + r[0, 2] * (m[5] + m[0] * py - m[1] * px)
    elastic = max(borne - STIFFNESS * (deepest - depth), 0.0)
    force = min(elastic * max(1.0 + LOSS * speed, 0.0), borne)
    along, down = -force, -q[3] * borne
    push(
        work,
        BUCKET,
        px,
        py,
        pz,
        along * r[0, 0] + down * r[2, 0],
        along * r[0, 1] + down * r[2, 1],
        along * r[0, 2] + down * r[2, 2],
    )


EFFECT = Effect(
    name="pile_entry",
    sentence="The bucket pushes into a pile.",
    equation="F <= G = F_max (1 - exp(-s/s0)), F_z = -c G",
    parameters=(
        Parameter(
            "distance_m", "m", 10.0, -1e3, 1e3, "where the pile begins, along the world's x axis", shape=True
        ),
        Parameter("most_N", "N", 60e3, 0.0, 300e3, "F_max: 20 to 100 kN"),
        Parameter(
            "depth_m",
            "m",
            0.5,
            0.01,
            10.0,
            "s0: depth at which it resists with 63 per cent of that",
            shape=True,
        ),
        Parameter(
            "weight_share",
            "1",
            0.5,
            -1.0,
            2.0,
            "c: load on the bucket over what the depth resists; negative when it digs itself up",
            shape=True,
        ),
        Parameter("edge_x_m", "m", 0.82, -1.0, 3.0, "cutting edge ahead of the pin, as carried", shape=True),
        Parameter("edge_z_m", "m", 0.88, -1.0, 3.0, "and above it", shape=True),
    ),
    acts_on="lift and tilt pressure, all normal forces, longitudinal force",
    signature="Both pressures jump while the speed falls to zero under torque; the front loads change.",
    excited_by="digging",
    confusable=(Confusable("payload_mass", "a payload shows at standstill away from the pile"),),
    source="elastic-plastic penetration",
    own_states=1,
)
