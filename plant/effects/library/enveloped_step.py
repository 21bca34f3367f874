"""A sharp step, as a tyre envelops it with two elliptical cams."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import along_ground, raise_ground
from plant.physics.parameters import W_RADIUS
from plant.physics.workspace import Workspace


@uncounted
def below(way: float, length: float, height: float, exponent: float) -> float:
    """How far the lower side of a cam is below its lowest point's tangent [m], negative above; at `way` [m] from its middle."""
    part = min(abs(way) / length, 1.0)
    return -height * (1.0 - (1.0 - part**exponent) ** (1.0 / exponent))


@uncounted
def cam_lift(
    ahead: float, step: float, radius: float, length: float, height: float, exponent: float
) -> float:
    """How far a cam stands above flat ground [m] when its middle is `ahead` [m] of a step up by `step` [m]; step < 0 down.

    The cam touches the upper level where it reaches over the edge: ellipse |x/a|^c + |z/b|^c = 1, a = length radius, b = height radius.
    """
    edge = below(ahead, length * radius, height * radius, exponent)
    if step >= 0.0:
        return step if ahead >= 0.0 else max(step + edge, 0.0)
    return 0.0 if ahead <= 0.0 else max(edge, step)


@uncounted
def enveloped(ahead: float, step: float, radius: float, q: Array) -> tuple[float, float]:
    """Height of the effective road [m] and its slope under a wheel whose centre is `ahead` [m] of the edge.

    q: from index 3 on, distance of the cams [m], length and height over the radius, exponent.
    """
    front = cam_lift(ahead + 0.5 * q[3], step, radius, q[4], q[5], q[6])
    behind = cam_lift(ahead - 0.5 * q[3], step, radius, q[4], q[5], q[6])
    return 0.5 * (front + behind), (front - behind) / q[3]


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """The effective road: mean height of both cams, and the slope between them."""
    way = along_ground(state, work, wheel) - q[0]
    height, slope = enveloped(way, q[1 + wheel % 2], work.local[wheel, W_RADIUS], q)
    raise_ground(state, work, wheel, height, slope)


EFFECT = Effect(
    name="enveloped_step",
    sentence="The tyres climb or leave a sharp edge, which they envelop.",
    equation="|x/a|^c + |z/b|^c = 1, w = (Z_f + Z_r)/2 - b, tan(beta) = (Z_f - Z_r)/l_s",
    parameters=(
        Parameter(
            "distance_m", "m", 10.0, -1e3, 1e3, "where the edge is, along the world's x axis", shape=True
        ),
        Parameter("left_m", "m", 0.1, -0.4, 0.4, "step up under the left wheels"),
        Parameter("right_m", "m", 0.1, -0.4, 0.4, "step up under the right wheels"),
        Parameter(
            "spacing_m", "m", 0.26, 0.02, 2.0, "l_s: of the cams, 0.8 of the contact's length", shape=True
        ),
        Parameter("length", "1", 1.0, 0.3, 2.0, "a over the tyre's radius", shape=True),
        Parameter("height", "1", 1.0, 0.3, 2.0, "b over the tyre's radius", shape=True),
        Parameter("exponent", "1", 1.8, 1.2, 4.0, "c", shape=True),
    ),
    acts_on="normal forces, longitudinal force, pitch, roll",
    signature="The wheels rise before the edge is below them, and are pushed back while they climb.",
    excited_by="driving over a kerb",
    confusable=(
        Confusable("kerb", "a ramp of one length for every height; a higher edge reaches the cams earlier"),
    ),
    source="tandem elliptical cams of MF-Swift: Schmeitz, TU Delft 2004; Pacejka, 3rd ed., chapter 10.1",
)
