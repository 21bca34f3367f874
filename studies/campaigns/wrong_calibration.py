"""Calibrations that are wrong as real ones are: what nobody weighs, measures or knows better than this.

Each number is drawn evenly within its error, by a seed. The friction of the ground is not drawn here: the ECU keeps that of its
calibration, and the ground differs.
"""

import random
from typing import Final

from ecu.calibration import Calibration, load_calibration
from ecu.estimators.parameters import Body, Parameters

MASS: Final = 0.03
"""Of a part, by data sheet [share]."""
PLACE: Final = 0.05
"""Of a centre of gravity [m]."""
RADIUS: Final = 0.01
"""Of a worn or swollen tyre [share]."""
STIFFNESS: Final = 0.15
"""Of a tyre, in all directions [share]."""


def wrong_calibration(name: str, seed: int) -> Calibration:
    """The calibration `name` with the errors of this seed; dataclasses.replace of what is wrong."""
    right = load_calibration(name)
    return Calibration(
        name=f"{right.name} with the errors of seed {seed}",
        parameters=wrong_parameters(right.parameters, random.Random(seed)),
        limits=right.limits,
        warnings=right.warnings,
        alarms=right.alarms,
        inputs=right.inputs,
        detection=right.detection,
    )


def wrong_parameters(p: Parameters, draw: random.Random) -> Parameters:
    """The parameters with errors; inertias go with their masses, as they do in a data sheet."""

    def scaled(share: float) -> float:
        return 1.0 + draw.uniform(-share, share)

    def off() -> float:
        return draw.uniform(-PLACE, PLACE)

    def body(b: Body) -> Body:
        # one factor for the mass and its inertias: a heavier part of the same shape
        k = scaled(MASS)
        inertias = (k * b.roll_inertia, k * b.pitch_inertia, k * b.yaw_inertia)
        return Body(k * b.mass, b.x + off(), b.z + off(), *inertias)

    arm, bucket, wheel, axle = scaled(MASS), scaled(MASS), p.wheel, scaled(MASS)
    # drawn apart: a tyre that is stiff radially need not be stiff along or across
    radial, slip, cornering = scaled(STIFFNESS), scaled(STIFFNESS), scaled(STIFFNESS)
    return p._replace(
        front=body(p.front),
        rear=body(p.rear),
        axle=p.axle._replace(mass=axle * p.axle.mass, roll_inertia=axle * p.axle.roll_inertia),
        arm=p.arm._replace(mass=arm * p.arm.mass, along=p.arm.along + off(), above=p.arm.above + off()),
        bucket=p.bucket._replace(
            mass=bucket * p.bucket.mass,
            forward=p.bucket.forward + off(),
            above=p.bucket.above + off(),
            payload_forward=p.bucket.payload_forward + off(),
            payload_above=p.bucket.payload_above + off(),
        ),
        wheel=wheel._replace(
            unloaded_radius=scaled(RADIUS) * wheel.unloaded_radius,
            radial_linear=radial * wheel.radial_linear,
            radial_quadratic=radial * wheel.radial_quadratic,
            slip_stiffness=slip * wheel.slip_stiffness,
            cornering_stiffness=cornering * wheel.cornering_stiffness,
        ),
        # the same tyre in another place of the calibration: it must not contradict itself
        prediction=p.prediction._replace(tyre_stiffness=radial * p.prediction.tyre_stiffness),
    )
