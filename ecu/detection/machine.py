"""Plain sizes of the machine that several residuals need."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import FILTERS
from ecu.estimators.parameters import GRAVITY, Parameters

Floats = NDArray[np.float64]

NOTHING: Final = 1e30
"""Bound of a residual that says nothing at present."""

STANDING: Final = 0.1
"""Below this speed a wheel may be held by its brake [rad/s]: its torque signal then lacks the brake, and it uses all of its grip."""
OBSERVED: Final = 1.0
"""Time in which an angle's observer forgets [s]."""
HALF_CYCLE: Final = 0.005
"""Half a cycle of the ECU [s]."""


@compiled
def over(time: float, limit: float) -> bool:
    """Whether a time that adds up from cycle to cycle has reached its limit [s], to the nearest cycle.

    Limits are whole cycles. Compared to the last bit, the rounding of the sum would say in which cycle one is reached, and
    single precision would have another answer than double.
    """
    return time > limit - HALF_CYCLE


@compiled
def remaining(time: float, dt: float) -> float:
    """What one more cycle leaves of a time that runs down [s]: 0 from the nearest cycle on."""
    left = time - dt
    return left if left > HALF_CYCLE else 0.0


@compiled
def effective_radius(p: Parameters) -> float:
    """Effective radius of a wheel at its nominal load [m]: (112) to first order, R0 - rho / 3."""
    return p.wheel.unloaded_radius * (1.0 - sunk(p) / 3.0)


@compiled
def sunk(p: Parameters) -> float:
    """Deflection of a tyre at its nominal load over its unloaded radius, by (118)."""
    w = p.wheel
    linear = w.radial_linear
    return (math.sqrt(linear * linear + 4.0 * w.radial_quadratic) - linear) / (2.0 * w.radial_quadratic)


@compiled
def machine_mass(p: Parameters) -> float:
    """Mass of the empty machine [kg]."""
    return p.front.mass + p.arm.mass + p.bucket.mass + p.rear.mass + p.axle.mass


@compiled
def standing_loads(payload: float, p: Parameters) -> tuple[float, float]:
    """Load of a front and of a rear wheel of the standing machine with so much payload [kg], in [N]."""
    base = p.geometry.front_length + p.geometry.rear_length
    reach = p.arm.pivot_x + 0.8 * p.arm.length + p.geometry.rear_length
    ahead = p.front.mass * (p.front.x + p.geometry.rear_length)
    ahead += p.arm.mass * (p.arm.pivot_x + 0.8 * p.arm.along + p.geometry.rear_length)
    ahead += p.rear.mass * (p.rear.x + p.geometry.rear_length)
    ahead += (p.bucket.mass + max(payload, 0.0)) * (reach + p.bucket.forward)
    front = ahead / base
    rear = max(machine_mass(p) + max(payload, 0.0) - front, 0.15 * machine_mass(p))
    return front * GRAVITY / 2.0, rear * GRAVITY / 2.0


@compiled
def turning_shares(payload: float, p: Parameters) -> tuple[float, float]:
    """Lateral force over load of the front and of the rear axle, per yaw acceleration of the straight machine [1/(rad/s2)].

    Two axles turn the machine as a couple; the lighter of them uses more of its grip for it. payload: [kg].
    """
    arm, bucket, rear, g = p.arm, p.bucket, p.rear, p.geometry
    reach, load = arm.pivot_x + 0.8 * arm.length, max(payload, 0.0)
    boom = arm.pivot_x + 0.8 * arm.along
    mass = machine_mass(p) + load
    tips = bucket.mass + load
    first = p.front.mass * p.front.x + arm.mass * boom + tips * (reach + bucket.forward)
    first += rear.mass * rear.x - p.axle.mass * g.rear_length
    second = p.front.mass * p.front.x * p.front.x + arm.mass * boom * boom
    second += tips * (reach + bucket.forward) * (reach + bucket.forward)
    second += rear.mass * rear.x * rear.x + p.axle.mass * g.rear_length * g.rear_length
    own = p.front.yaw_inertia + arm.yaw_inertia + bucket.yaw_inertia + rear.yaw_inertia
    own += p.axle.roll_inertia  # that of a slender axle about z
    about = (
        own + load * bucket.payload_yaw_gyration * bucket.payload_yaw_gyration + second - first * first / mass
    )
    couple = about / (g.front_length + g.rear_length)
    front, behind = standing_loads(payload, p)
    return couple / (2.0 * front), couple / (2.0 * behind)


@compiled
def follow(state: Floats, place: int, value: float, share: float) -> float:
    """A first-order filter kept in the state."""
    state[FILTERS, place] += share * (value - state[FILTERS, place])
    return state[FILTERS, place]
