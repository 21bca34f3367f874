"""A pneumatic cylinder that is held at constant pressure and moved: the rod's force is pressure times area.

Recordings: O-ring seal at 1, 3, 5 and 7 bar, 100 Hz (EvaZillen/3D-printed-pneumatic-actuator, CC0).
"""

from collections.abc import Mapping

import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

CREEP_M_S = 2e-4  # speed within which the direction of a stroke is not certain


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    speed = np.gradient(window["position"], window.step_s)
    direction = np.tanh(speed / CREEP_M_S)
    seal = values.get("seal", 0.0) + values.get("seal_per_pressure", 0.0) * window["pressure"]
    force = (
        values["area"] * window["pressure"] + values["preload"] + seal * direction + extra.get("force", 0.0)
    )
    return {"force": force + values.get("viscous", 0.0) * speed}


def _friction(name: str, sentence: str, equation: str, *parameters: Parameter) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=parameters, kind="physics", place="seals",
        excited_by="strokes in both directions",
    )  # fmt: skip


model = Model(
    name="pneumatic cylinder",
    sentence="a cylinder whose rod carries pressure times area",
    inputs={"pressure": "Pa", "position": "m"},
    outputs={"force": "N"},
    columns={"position": "piston position", "force": "rod force"},
    nuisances=(
        Parameter(name="area", unit="m^2", value=4.95e-4, lower=4e-4, upper=6e-4, typical=5e-6, prior_sd=1e-5),
        Parameter(name="preload", unit="N", typical=1.0, prior_sd=5.0),
    ),
    effects=(
        _friction(
            "seal friction", "the seals resist the motion with a constant force", "F = p A + F0 + Fc sign(v)",
            Parameter(name="seal", unit="N", lower=-20.0, upper=20.0, typical=1.0),
        ),
        _friction(
            "seal friction with pressure", "the seals resist the motion in proportion to the pressure",
            "F = p A + F0 + c p sign(v)",
            Parameter(name="seal_per_pressure", unit="N/Pa", lower=-2e-4, upper=2e-4, typical=1e-5),
        ),
        _friction(
            "viscous friction", "the seals resist the motion in proportion to the speed", "F = p A + F0 + d v",
            Parameter(name="viscous", unit="N.s/m", lower=-1e4, upper=1e4, typical=100.0),
        ),
        *sensor_effects("force", "N", bias=1.0, kinds=("scale", "lag", "delay")),
    ),
    simulate=simulate,
    step_s=0.01,
)  # fmt: skip
