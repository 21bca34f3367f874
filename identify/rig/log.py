"""The log of a rig as plain data: runs of cylinder speed, force and shaft speed, and the calibration of its piston. SI."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.tyre.parameters import Nominal

Array = NDArray[np.float64]

KINDS = ("drive", "brake", "steps", "validation")


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRun:
    """One run as it was recorded; NaN where a sample is missing."""

    name: str
    kind: str  # one of KINDS, or empty if the description does not state it
    time: Array  # (n,) [s]
    cylinder_speed: Array  # V_cyl, tangential (n,) [m/s]
    force: Array  # F_x on the cylinder, positive when the tyre drives it (n,) [N]
    shaft_speed: Array  # n_cs of the cardan shaft (n,) [rev/s]
    piston_pressure: float  # p_c [Pa]
    inflation: float  # p_i [Pa]


@dataclass(frozen=True, slots=True, kw_only=True)
class PistonCalibration:
    """Loaded radius at piston pressures, and the vertical stiffness that makes loads of them."""

    piston_pressure: Array  # (m,) [Pa]
    loaded_radius: Array  # (m,) [m]
    radius_sd: float  # of one reading [m]
    q1: float  # of (118), relative to nominal load and radius
    q2: float
    stiffness_sd: float  # relative, common to all loads


@dataclass(frozen=True, slots=True, kw_only=True)
class RigLog:
    """All runs of one tyre, and the accuracies of its certificates."""

    name: str
    nominal: Nominal
    runs: Sequence[RigRun]
    calibration: PistonCalibration
    gain_sd: float = 0.005  # of the force's scale, relative
    shortest_relaxation: float = 0.05  # [m] below which a relaxation length is not resolved
