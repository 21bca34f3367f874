"""Rolling resistance: the tyre's hysteresis shifts its load ahead of the axle."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import resist_rolling, spin
from plant.physics.parameters import W_RADIUS
from plant.physics.workspace import Workspace


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Moment against the wheel's spin, proportional to its load."""
    turning = spin(work, wheel)
    growth = q[1] * abs(turning) * work.local[wheel, W_RADIUS]
    resist_rolling(work, wheel, turning, q[0] * (1.0 + growth))


EFFECT = Effect(
    name="rolling_resistance",
    sentence="The tyres take a torque to roll, in proportion to their load.",
    equation="M_y = -f (1 + k |V|) N R0 sgn(omega)",
    parameters=(
        Parameter(
            name="coefficient",
            unit="1",
            typical=0.025,
            low=0.0,
            high=0.3,
            meaning="f: 0.015 on a hard road, 0.03 to 0.05 on gravel, above 0.1 in sand",
        ),
        Parameter(
            name="growth_per_m_per_s",
            unit="s/m",
            typical=0.01,
            low=0.0,
            high=0.2,
            meaning="k: growth with speed",
            shape=True,
        ),
    ),
    acts_on="wheel torque, longitudinal force, speed",
    signature="Torque is needed at constant speed on level ground; the machine slows down when coasting.",
    excited_by="coasting down, in both directions",
    confusable=(
        Confusable(
            name="grade", separate="the slope's force changes its sign against the motion with the direction"
        ),
        Confusable(name="brake_drag", separate="drag does not grow with the wheel's load"),
        Confusable(
            name="soil_sinkage", separate="sinkage grows faster than the load, and less on a second pass"
        ),
    ),
    source="Wong, Theory of Ground Vehicles, 4th ed., section 1.2; values for earthmover tyres",
)
