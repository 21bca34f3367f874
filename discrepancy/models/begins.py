"""Stretches that begin otherwise than the pilot says: higher or turned by a little, in another bounce, faster."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discrepancy.models.loader_library import BEGINS
from discrepancy.models.shared_out import Way
from discrepancy.recording import Array
from plant import state as s
from plant.follow import M_SPEED
from plant.resting import R_START


def begun_otherwise(values: Mapping[str, float], starts: Array, rests: Array, way: Way, radius: float) -> Way:
    """Change starts (n, STATES) and rests (n, REST) in place by what BEGINS say; the way, with the speeds at which stretches begin.

    radius: of a wheel [m].
    """
    told = [values.get(p.name, 0.0) for p in BEGINS]
    if not any(told):
        return way
    height, height_rate, roll, pitch, roll_rate, pitch_rate, speed = told
    starts[:, s.POSITION + 2] += height
    rests[:, R_START] += height
    starts[:, s.VELOCITY + 2] += height_rate
    w, x, y, z = starts[:, s.ATTITUDE : s.ATTITUDE + 4].copy().T
    turned = (-x * roll - y * pitch, w * roll - z * pitch, z * roll + w * pitch, x * pitch - y * roll)
    starts[:, s.ATTITUDE : s.ATTITUDE + 4] += 0.5 * np.stack(turned, axis=1)  # about its own axes
    starts[:, s.ANGULAR] += roll_rate
    starts[:, s.ANGULAR + 1] += pitch_rate
    measured = way.measured.copy()
    measured[way.edges[:-1], M_SPEED] += speed / radius
    return replace(way, measured=measured)
