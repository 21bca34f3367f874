"""Curves that an effect's parameters give point by point."""

from plant.compiled import uncounted
from plant.effects.effect import Array


@uncounted
def between_knots(x: float, knots: tuple[float, float, float, float], values: Array) -> float:
    """The broken line through `values` at rising `knots`, constant beyond the first and the last one."""
    # numpy.interp allocates arrays, which a step of the plant must not
    if x <= knots[0]:
        return float(values[0])
    for i in range(3):
        if x < knots[i + 1]:
            along = (x - knots[i]) / (knots[i + 1] - knots[i])
            return float(values[i] + along * (values[i + 1] - values[i]))
    return float(values[3])
