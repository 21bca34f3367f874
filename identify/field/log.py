"""The log of a field test as plain data: motion capture beside the machine and a wheel transducer on it, each with its own clock. SI."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.tyre.parameters import Nominal

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Vicon:
    """Motion of the wheel's markers; y is 0 outside the scope. Stamps may repeat, be uneven, or late."""

    time: Array  # (n,) [s]
    x: Array  # of the wheel's centre in the world (n,) [m]
    y: Array
    z: Array
    pitch: Array  # rotation of the wheel about its axle, positive rolling forwards, wrapped (n,) [rad]
    yaw: Array  # heading of the wheel in the world (n,) [rad]
    sync: Array  # voltage of the sync vector (n,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Somat:
    """The wheel transducer."""

    time: Array  # (m,) [s], begins at 0 with the pulse
    angle: Array  # of the encoder, wrapped (m,) [rad]
    fx: Array  # along the wheel's heading (m,) [N]
    fy: Array
    fz: Array  # on the hub: without the weight of the wheel


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldLog:
    """One measurement on one surface, and the data sheet of its tyre."""

    name: str
    nominal: Nominal
    vicon: Vicon
    somat: Somat
    ground: Array  # points of the ground (k, 3) [m]
    wheel_weight: float = 4190.0  # [N]
    gain_sd: float = 0.005  # of both forces' scale, relative
    radius_sd: float = 0.003  # of the loaded radius [m]: markers are not exactly on the axle
    standing_s: float = (
        3.0  # at the start of the transducer's log, in which the machine stands without brakes
    )


__all__ = ["FieldLog", "Somat", "Vicon"]
