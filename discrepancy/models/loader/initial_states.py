"""Initial states of segments, changed by the parameters of INITIAL_STATES: higher, tilted, in another bounce, faster."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discrepancy.models.loader.nuisances import INITIAL_STATES
from discrepancy.models.loader.replay_inputs import ReplayInputs
from discrepancy.signals.recording import Array
from plant.physics import state as s
from plant.physics.resting import R_START
from plant.replay import M_SPEED


def changed_starts(
    values: Mapping[str, float], starts: Array, rests: Array, inputs: ReplayInputs, radius: float
) -> tuple[Array, Array, ReplayInputs]:
    """Initial states (n, STATES), rests (n, REST) and inputs with the values of INITIAL_STATES added; radius: of a wheel [m].

    The speed is changed in the inputs, since a replay starts at the measured speed.
    """
    changes = [values.get(p.name, 0.0) for p in INITIAL_STATES]
    if not any(changes):
        return starts, rests, inputs
    starts, rests = starts.copy(), rests.copy()
    height, height_rate, roll, pitch, roll_rate, pitch_rate, speed = changes
    starts[:, s.POSITION + 2] += height
    rests[:, R_START] += height  # the rest holds the height at which the motion starts; both must agree
    starts[:, s.VELOCITY + 2] += height_rate
    w, x, y, z = starts[:, s.ATTITUDE : s.ATTITUDE + 4].copy().T
    # first order of a quaternion product: a small rotation about the machine's own axes
    turned = (-x * roll - y * pitch, w * roll - z * pitch, z * roll + w * pitch, x * pitch - y * roll)
    starts[:, s.ATTITUDE : s.ATTITUDE + 4] += 0.5 * np.stack(turned, axis=1)
    starts[:, s.ANGULAR] += roll_rate
    starts[:, s.ANGULAR + 1] += pitch_rate
    measured = inputs.measured.copy()
    measured[inputs.edges[:-1], M_SPEED] += speed / radius
    return starts, rests, replace(inputs, measured=measured)
