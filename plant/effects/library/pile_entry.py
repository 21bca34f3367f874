"""A pile that the bucket is driven into."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import in_world, push
from plant.physics.state import BUCKET
from plant.physics.workspace import Workspace

STIFFNESS = 2.0e6  # of the packed pile [N/m]
LOSS = 1.0  # of the packed pile: by how much more it resists per speed at which it is pressed together [s/m]
LOOSE = 8e3  # within so much of what it bears the pile gives way gradually [N]; less is too stiff for steps of 5 ms


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Resistance at the bucket's edge, up to what the depth dug so far bears; what was dug weighs on the bucket.

    Dug ground does not push back. The nearer the force is to what the pile bears, the larger a share of the motion digs (Dahl's law); beyond
    that the pile gives way faster than the bucket comes. Nothing jumps at the first touch (Hunt and Crossley's damping): a jump there
    would give the machine a push that depends on the step of the integration.
    """
    pin, axes = work.places.points[3], work.places.axes[4]
    px, py, pz = pin[0], pin[1], pin[2]
    px += q[4] * axes[0, 0] + q[5] * axes[0, 2]
    py += q[4] * axes[1, 0] + q[5] * axes[1, 2]
    pz += q[4] * axes[2, 0] + q[5] * axes[2, 2]
    edge, _, _ = in_world(state, work, px, py, pz)
    pressed = edge - q[0] - state[x]
    grown, r = q[1] * (1.0 - math.exp(-state[x] / q[2])), work.places.world
    force = 0.0
    m = work.tree.motion[BUCKET]
    speed = r[0, 0] * (m[3] + m[1] * pz - m[2] * py)
    speed += r[0, 1] * (m[4] + m[2] * px - m[0] * pz) + r[0, 2] * (m[5] + m[0] * py - m[1] * px)
    if pressed > 0.0:
        ahead = max(speed, 0.0)
        work.rate[x] = ahead * (STIFFNESS * pressed + LOOSE) / (grown + LOOSE)
        force = STIFFNESS * pressed * max(1.0 + LOSS * (speed - min(work.rate[x], ahead)), 0.0)
    along, down = -force, -q[3] * grown
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
