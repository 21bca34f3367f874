"""Distances from a lawn mower to four radio beacons: the Plaza 1 recording of Djugash and Roth (CMU), with the mower's place by satellite.

It reads the table of `python -m bench.plaza`, which has a column of distances for each beacon.
"""

from collections.abc import Mapping

import numpy as np

from discrepancy.model import Array, Effect, Model, Parameter, Window, sensor_effects

BEACONS = {  # surveyed places [m]
    "distance_0": (-46.623234, 11.025549),
    "distance_1": (11.036124, -6.958689),
    "distance_5": (-17.664893, 59.009181),
    "distance_6": (22.053129, 23.848482),
}


def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    x, y = window["east"] + extra.get("east", 0.0), window["north"] + extra.get("north", 0.0)
    late = np.interp(window.time_s - values.get("late", 0.0), window.time_s, np.arange(x.size))
    x, y = (np.interp(late, np.arange(x.size), place) for place in (x, y))
    found = {}
    for name, (east, north) in BEACONS.items():
        true = np.sqrt((x - east) ** 2 + (y - north) ** 2 + values.get("height", 0.0))
        found[name] = (1.0 + values.get("scale", 0.0)) * true + values.get("offset", 0.0)
    return found


def _radio(name: str, sentence: str, equation: str, parameter: Parameter) -> Effect:
    return Effect(
        name=name, sentence=sentence, equation=equation, parameters=(parameter,), kind="physics", place="radios",
        excited_by="near and far beacons",
    )  # fmt: skip


model = Model(
    name="plaza ranging",
    sentence="a radio measures the distance to a beacon",
    inputs={"east": "m", "north": "m"},
    outputs=dict.fromkeys(BEACONS, "m"),
    columns={"east": "x", "north": "y", **{name: name.replace("_", " to beacon ") for name in BEACONS}},
    effects=(
        _radio(
            "scale of the radios", "every distance is read in proportion too large", "r = (1 + s) d",
            Parameter(name="scale", unit="1", lower=-0.5, upper=0.5, typical=0.01),
        ),
        _radio(
            "offset of the radios", "every distance is read too large by a constant", "r = d + b",
            Parameter(name="offset", unit="m", lower=-20.0, upper=20.0, typical=0.2),
        ),
        _radio(
            "height of the antennas", "beacons stand higher or lower than the mower's antenna", "r^2 = d^2 + h^2",
            Parameter(name="height", unit="m^2", lower=0.0, upper=400.0, typical=4.0),
        ),
        _radio(
            "late distances", "the radios answer late, while the mower moves on", "r(t) = d(t - T)",
            Parameter(name="late", unit="s", lower=-2.0, upper=2.0, typical=0.1),
        ),
        *(each for name in BEACONS for each in sensor_effects(name, "m", bias=0.5, kinds=("bias", "scale"))),
    ),
    simulate=simulate,
    step_s=0.25,
    window_s=120.0,
)  # fmt: skip
