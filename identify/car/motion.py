"""Motion of a car's body from motion capture: smoothed velocities in its own axes, and what its axles carried."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.car.log import Car, CarLog
from identify.signals.filters import low_pass
from identify.signals.kalman import motion

Array = NDArray[np.float64]

RATE_HZ = 100.0
CUTOFF_HZ = 4.0  # of accelerations: a car turns more slowly, its markers shake faster
SLOWEST = 0.5  # [m/s] below which a slip angle is noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """On an even grid (n,), SI, ISO 8855: x forwards, y to the left."""

    time: Array
    forward: Array  # speed at the rear axle
    yaw_rate: Array
    rear_slip: Array  # tangent of the rear axle's slip angle, positive if it pushes to the left
    rear_grip: Array  # lateral force of the rear axle over its weight
    front_direction: Array  # in which the front axle moves, tangent to the left of the car's own axis
    front_grip: Array  # lateral force of the front axle over its weight
    kept: NDArray[np.bool_]


def body_motion(log: CarLog, car: Car) -> Body:
    """The rear axle does not steer: its slip angle is geometry alone. Its force follows from the moments about the front axle."""
    moved = [motion(log.time, value) for value in (log.x, log.y, log.yaw)]
    time = np.arange(log.time[0], log.time[-1], 1.0 / RATE_HZ)
    vx, vy, rate, yaw = (
        np.interp(time, log.time, v)
        for v in (moved[0].velocity, moved[1].velocity, moved[2].velocity, moved[2].position)
    )
    forward = vx * np.cos(yaw) + vy * np.sin(yaw)
    across = -vx * np.sin(yaw) + vy * np.cos(yaw)  # of the marker
    slow_rate = low_pass(rate, RATE_HZ, CUTOFF_HZ, 2)
    at_centre = low_pass(across, RATE_HZ, CUTOFF_HZ, 2) - (car.marker - car.centre) * slow_rate
    lateral = np.gradient(at_centre, 1.0 / RATE_HZ) + low_pass(forward * rate, RATE_HZ, CUTOFF_HZ, 2)
    turning = np.gradient(slow_rate, 1.0 / RATE_HZ)
    front = car.wheelbase - car.centre
    force = {
        "rear": (front * car.mass * lateral - car.inertia * turning) / car.wheelbase,
        "front": (car.centre * car.mass * lateral + car.inertia * turning) / car.wheelbase,
    }
    weight = car.mass * 9.81 / car.wheelbase
    speed = np.maximum(forward, SLOWEST)
    at_axle = {"rear": across - car.marker * rate, "front": across + (car.wheelbase - car.marker) * rate}
    direction = {name: low_pass(v / speed, RATE_HZ, CUTOFF_HZ, 2) for name, v in at_axle.items()}
    gaps = np.interp(time, log.time[1:], np.diff(log.time)) > 0.1
    return Body(
        time=time,
        forward=forward,
        yaw_rate=rate,
        rear_slip=-direction["rear"],
        rear_grip=force["rear"] / (weight * front),
        front_direction=direction["front"],
        front_grip=force["front"] / (weight * car.centre),
        kept=(forward > SLOWEST) & ~gaps,
    )
