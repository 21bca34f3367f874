"""Parts of the parameter vector that effects change once."""

from plant.effects.effect import Array
from plant.physics.parameters import BODY_SIZE, P_WHEELS, WHEEL_SIZE


def wheel_blocks(p: Array) -> list[Array]:
    """The blocks of the four wheels, to be written to."""
    return [p[P_WHEELS + i * WHEEL_SIZE : P_WHEELS + (i + 1) * WHEEL_SIZE] for i in range(4)]


def body_block(p: Array, start: int) -> Array:
    """The block of a body (mass, centre, inertia about the centre), to be written to."""
    return p[start : start + BODY_SIZE]
