"""Resistance to rolling by a curve of its own over speed: whatever law it follows, where none is known."""

from plant.compiled import uncounted
from plant.effects.curves import between_knots
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import resist_rolling, spin
from plant.physics.parameters import W_RADIUS
from plant.physics.workspace import Workspace

KNOTS = (0.5, 1.5, 3.0, 6.0)  # [m/s]; a loader works below the last one
SHARE = "resistance over load at"


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Moment against the wheel's spin, proportional to its load."""
    turning = spin(work, wheel)
    speed = abs(turning) * work.local[wheel, W_RADIUS]
    resist_rolling(work, wheel, turning, between_knots(speed, KNOTS, q))


EFFECT = Effect(
    name="resistance_curve",
    sentence="Rolling takes a torque that depends on the speed by a law of its own.",
    equation="M_y = -f(|V|) N R0 sgn(omega), f linear between 0.5, 1.5, 3 and 6 m/s",
    parameters=(
        Parameter("at_0_5", "1", 0.02, 0.0, 0.3, f"{SHARE} 0.5 m/s and below"),
        Parameter("at_1_5", "1", 0.02, 0.0, 0.3, f"{SHARE} 1.5 m/s"),
        Parameter("at_3", "1", 0.02, 0.0, 0.3, f"{SHARE} 3 m/s"),
        Parameter("at_6", "1", 0.02, 0.0, 0.3, f"{SHARE} 6 m/s and beyond"),
    ),
    acts_on="wheel torque, longitudinal force, speed",
    signature="Torque at constant speed on level ground, by another law than in proportion to load or speed.",
    excited_by="constant speeds, slow and fast; coasting down",
    confusable=(
        Confusable("rolling_resistance", "that of the tyres alone grows evenly with speed"),
        Confusable("brake_drag", "drag does not depend on speed, nor on load"),
        Confusable("aerodynamic_drag", "air's grows with the square of speed and not with load"),
    ),
    source="a broken line, as coast-down tables are: SAE J1263, Road Load Measurement",
)
