"""A double pendulum driven at both joints: records of DFKI's design A.0 for its identification (2022), 500 Hz."""

import math
from collections.abc import Mapping
from typing import Any

import numba
import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

GRAVITY = 9.81
UPPER_M = 0.3  # length of the upper arm
STEEPNESS = 100.0  # s/rad: dry friction as published, c atan(100 w); 2/pi of it is the usual c


def _swung(
    t1: Array, t2: Array, h: float, i1: float, i2: float, g1: float, g2: float, b1: float, b2: float, c1: float, c2: float,
    a1: float, a2: float, w1: float, w2: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Both angles. i1, i2: about the joints, with the lower arm as a point at the elbow in i1; g: mass times distance."""
    first, second = np.empty(t1.size), np.empty(t1.size)
    for i in range(t1.size):
        first[i], second[i] = a1, a2
        s, c = math.sin(a2), math.cos(a2)
        m12 = i2 + g2 * UPPER_M * c
        m11 = i1 + i2 + 2.0 * g2 * UPPER_M * c
        r1 = (
            t1[i]
            + g2 * UPPER_M * s * (2.0 * w1 + w2) * w2
            - GRAVITY * (g1 * math.sin(a1) + g2 * math.sin(a1 + a2))
        )
        r2 = t2[i] - g2 * UPPER_M * s * w1 * w1 - GRAVITY * g2 * math.sin(a1 + a2)
        r1 -= b1 * w1 + c1 * math.atan(STEEPNESS * w1)
        r2 -= b2 * w2 + c2 * math.atan(STEEPNESS * w2)
        det = m11 * i2 - m12 * m12
        v1, v2 = w1, w2
        w1 += h * (i2 * r1 - m12 * r2) / det
        w2 += h * (m11 * r2 - m12 * r1) / det
        a1 += 0.5 * h * (v1 + w1)
        a2 += 0.5 * h * (v2 + w2)
    return first, second


_compiled: Any = numba.njit(_swung)


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    torques = [window[name] + extra.get(name, 0.0) for name in ("shoulder_torque", "elbow_torque")]
    arms = (values[name] for name in ("inertia_1", "inertia_2", "moment_1", "moment_2"))
    friction = (values.get(name, 0.0) for name in ("viscous_1", "viscous_2", "dry_1", "dry_2"))
    start = (values[name] for name in ("start_1", "start_2", "start_speed_1", "start_speed_2"))
    shoulder, elbow = _compiled(*torques, window.step_s, *arms, *friction, *start)
    return {"shoulder": shoulder, "elbow": elbow}


def _friction(joint: str, number: int) -> tuple[Effect, ...]:
    return tuple(
        Effect(
            name=f"{kind} friction of the {joint}", sentence=f"the {joint} resists {how}", equation=equation, kind="physics",
            place=joint, excited_by="both directions at several speeds",
            parameters=(Parameter(name=f"{kind}_{number}", unit=unit, lower=0.0, upper=2.0, typical=0.05),),
        )
        for kind, how, equation, unit in (
            ("viscous", "in proportion to its speed", "... - b w", "N.m.s/rad"),
            ("dry", "with a constant torque", "... - c atan(100 w)", "N.m"),
        )
    )  # fmt: skip


def _start(joint: str, number: int) -> tuple[Parameter, Parameter]:
    return (
        Parameter(
            name=f"start_{number}", unit="rad", typical=0.01, scope="window", guess=lambda window: window.at_start(joint)
        ),
        Parameter(name=f"start_speed_{number}", unit="rad/s", typical=0.2, scope="window"),
    )  # fmt: skip


model = Model(
    name="double pendulum",
    sentence="two rigid arms with frictionless joints",
    inputs={"shoulder_torque": "N.m", "elbow_torque": "N.m"},
    outputs={"shoulder": "rad", "elbow": "rad"},
    columns={
        "shoulder_torque": "shoulder torque measured", "elbow_torque": "elbow torque measured",
        "shoulder": "shoulder angle", "elbow": "elbow angle",
    },
    nuisances=(  # as drawn: 0.56 kg at the elbow, 0.60 kg at the tip, a tenth uncertain
        Parameter(name="inertia_1", unit="kg.m^2", value=0.104, lower=0.02, upper=0.3, typical=0.005, prior_sd=0.02),
        Parameter(name="inertia_2", unit="kg.m^2", value=0.024, lower=0.005, upper=0.1, typical=0.001, prior_sd=0.005),
        Parameter(name="moment_1", unit="kg.m", value=0.35, lower=0.1, upper=0.8, typical=0.02, prior_sd=0.05),
        Parameter(name="moment_2", unit="kg.m", value=0.11, lower=0.02, upper=0.3, typical=0.005, prior_sd=0.02),
        *_start("shoulder", 1),
        *_start("elbow", 2),
    ),
    effects=(
        *_friction("shoulder", 1),
        *_friction("elbow", 2),
        *sensor_effects("shoulder", "rad", bias=0.01, kinds=("bias", "delay")),
        *sensor_effects("elbow", "rad", bias=0.01, kinds=("bias", "delay")),
    ),
    simulate=simulate,
    step_s=0.002,
    window_s=0.5,
)  # fmt: skip
