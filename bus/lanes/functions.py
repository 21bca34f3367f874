"""Sine, cosine, arctangent and exponential function for vectors, which the C library has for single numbers only.

Source of the coefficients: FDLIBM 5.3 (Sun Microsystems, freely distributable): s_atan.c, e_exp.c, k_sin.c, k_cos.c and the reduction of
e_rem_pio2.c for moderate angles. Both sides of each branch are computed, so there are few of them. Errors are below two units in the last place
(tests/bus/lanes/test_functions.py); angles of more than LARGEST_ANGLE lose digits.
"""

import math
from typing import Final

from bus.lanes.markers import power_of_two, to_whole

LARGEST_ANGLE: Final = 1e5
"""Up to here [rad] the reduction to a quarter turn is exact enough."""

TWO_OVER_PI: Final = 6.36619772367581382433e-01
HALF_PI: Final = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""A quarter turn in three parts: the first two have 33 bits, so that their products with a whole number are exact."""


def quarter_turns(x: float) -> tuple[float, float]:
    """Whole number of quarter turns in an angle, and the rest of it, at most an eighth of a turn [rad]."""
    turns = to_whole(x * TWO_OVER_PI)
    return turns, ((x - turns * HALF_PI[0]) - turns * HALF_PI[1]) - turns * HALF_PI[2]


def sine_near_zero(x: float) -> float:
    """Sine of at most an eighth of a turn."""
    z = x * x
    series = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    series = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * series)
    return x + x * z * (-1.66666666666666324348e-01 + z * series)


def cosine_near_zero(x: float) -> float:
    """Cosine of at most an eighth of a turn."""
    z = x * x
    series = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
    series = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * series)
    series = z * z * (4.16666666666666019037e-02 + z * series)
    half = 0.5 * z
    near = 1.0 - half
    return near + ((1.0 - near) - half + series)


def is_odd(whole: float) -> bool:
    """Whether a whole number is odd."""
    return 0.5 * whole != math.floor(0.5 * whole)


def in_second_half(turns: float) -> bool:
    """Whether this many quarter turns end in the second half of a turn."""
    part = 0.25 * turns
    return part - math.floor(part) >= 0.5


def sin(x: float) -> float:
    """Sine."""
    turns, rest = quarter_turns(x)
    value = cosine_near_zero(rest) if is_odd(turns) else sine_near_zero(rest)
    return -value if in_second_half(turns) else value


def cos(x: float) -> float:
    """Cosine."""
    turns, rest = quarter_turns(x)
    value = sine_near_zero(rest) if is_odd(turns) else cosine_near_zero(rest)
    return -value if in_second_half(turns + 1.0) else value


def atan(x: float) -> float:
    """Arctangent: of the difference to the nearest of four angles whose tangent is known."""
    size = abs(x)
    above, below, known, rest_of_known = size, 1.0, 0.0, 0.0
    if size >= 0.4375:
        above, below = size + size - 1.0, 2.0 + size
        known, rest_of_known = 4.63647609000806093515e-01, 2.26987774529616870924e-17  # of 1/2
    if size >= 0.6875:
        above, below = size - 1.0, size + 1.0
        known, rest_of_known = 7.85398163397448278999e-01, 3.06161699786838301793e-17  # of 1
    if size >= 1.1875:
        above, below = size - 1.5, 1.0 + 1.5 * size
        known, rest_of_known = 9.82793723247329054082e-01, 1.39033110312309984516e-17  # of 3/2
    if size >= 2.4375:
        above, below = -1.0, size
        known, rest_of_known = 1.57079632679489655800e00, 6.12323399573676603587e-17  # a quarter turn
    t = above / below
    z = t * t
    w = z * z
    odd = 6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)
    odd = 1.42857142725034663711e-01 + w * (9.09088713343650656196e-02 + w * odd)
    odd = z * (3.33333333333329318027e-01 + w * odd)
    even = -5.83357013379057348645e-02 + w * -3.65315727442169155270e-02
    even = -1.11111104054623557880e-01 + w * (-7.69187620504482999495e-02 + w * even)
    even = w * (-1.99999999998764832476e-01 + w * even)
    return math.copysign(known - ((t * (odd + even) - rest_of_known) - t), x)


def exp(x: float) -> float:
    """Exponential function; beyond the range of normal doubles its value at the end of the range."""
    x = min(max(x, -708.0), 709.0)
    power = to_whole(x * 1.44269504088896338700e00)
    high, low = x - power * 6.93147180369123816490e-01, power * 1.90821492927058770002e-10
    rest = high - low
    z = rest * rest
    series = 6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08)
    series = rest - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * series))
    return power_of_two(power) * (1.0 - ((low - (rest * series) / (2.0 - series)) - high))
