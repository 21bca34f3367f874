"""A law of the loader's wild arms: ground of several wavelengths, the same left and right."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Effect, Parameter
from plant.effects.ports import along_ground, raise_ground
from plant.physics.workspace import Workspace

LENGTHS = (1.3, 2.1, 3.7, 6.1, 11.3)  # [m]; no two have a common multiple


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Sines whose heights grow with their lengths, as those of roads do."""
    ahead, height, slope = along_ground(state, work, wheel), 0.0, 0.0
    for length in LENGTHS:
        number = 2.0 * math.pi / length
        amplitude = q[0] * length / LENGTHS[-1]
        height += amplitude * math.sin(number * ahead + q[1] * length)
        slope += amplitude * number * math.cos(number * ahead + q[1] * length)
    raise_ground(state, work, wheel, height, slope)


EFFECT = Effect(
    name="rough_ground",
    sentence="The ground is uneven.",
    equation="z = a sum L/L_max sin(2 pi x/L + c L)",
    parameters=(
        Parameter("amplitude_mm", "mm", 15.0, 0.0, 200.0, "a: of the longest wave", si=1e-3),
        Parameter("phase_per_m", "rad/m", 1.0, -100.0, 100.0, "c", shape=True),
    ),
    acts_on="normal forces, longitudinal force, pitch",
    signature="Pitch and heave of many frequencies, in proportion to speed.",
    excited_by="driving",
    source="ISO 8608: displacement spectra that fall with the square of the wave number",
)
