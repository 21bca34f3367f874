"""The single contact point: force of a tyre whose slip is measured over time, with derivatives.

sigma d(kappa')/dt + |V| kappa' = V_wheel - V, force = Magic Formula of kappa' (thesis (33)-(35), the sign corrected).
The relaxation length sigma is a constant, or the slope of the curve over the stiffness of the carcass, so that it falls with slip.
Each step solves the equation exactly for a frozen sigma, first over half of the step to find the sigma in its middle.
Steps much longer than sigma/V stay stable.

Noise of the measured speeds adds up in the transient slip as a random walk with a memory of sigma/|V|: seconds at walking speed. A
simulation would charge it to the tyre. So the measured force corrects the transient slip by a Kalman gain, and the residuals are errors of
one-step predictions (Ljung, System Identification, section 7.4). Without noise of the speeds the gain is 0 and this is a simulation.
A fit holds the gains of its start: a predictor with given gains is as consistent, and its derivatives are then exact. With gains that follow
the curve, a fit buys smaller errors with a wrong slope.
"""

import math

import numpy as np
from numpy.typing import NDArray

from identify.compiled import compiled
from identify.tyre.curve import S_H, force_and_slope

Array = NDArray[np.float64]

CARCASS, CONSTANT = 0, 1
"""Laws of the relaxation length: slope/stiffness, or a constant."""

LAW = 7
"""Column of the derivative by the law's number: carcass stiffness [N/m] or relaxation length [m]."""
SCALE = 8
"""Column of the derivative by the relative error of the wheel's speed."""
START = 9
"""Column of the derivative by the transient slip at the beginning."""
GAIN = 10
"""Column of the derivative by the gain of the measured force."""
TARE = 11
"""Column of the derivative by its zero [N]."""
COLUMNS = 12
SLOWEST = 1e-3  # speed [m/s] below which the road counts as standing


@compiled
def relaxation(
    law: int, number: float, shortest: float, curve: Array, kappa: float, grad: Array, slope: Array
) -> float:
    """Relaxation length [m] at a slip; its derivatives into `grad` (8,): by the curve, of which S_H is also that by kappa, and the law's number."""
    for i in range(8):
        grad[i] = 0.0
    if law == CONSTANT:
        grad[7] = 1.0
        return number
    _, rise = force_and_slope(curve, kappa, grad[:7], slope)
    for i in range(7):
        grad[i] = slope[i] / number
    length = rise / number
    grad[7] = -length / number
    if length < shortest:
        for i in range(8):
            grad[i] = 0.0
        return shortest
    return length


@compiled
def _advance(
    kappa: float, length: float, speed: float, sliding: float, step: float
) -> tuple[float, float, float, float]:
    """Slip after a step, its derivatives by slip and length, and what `sliding` contributes per m/s."""
    decay = math.exp(-speed * step / length)
    if speed > SLOWEST:
        target = sliding / speed
        by_length = (kappa - target) * decay * speed * step / (length * length)
        return target + (kappa - target) * decay, decay, by_length, (1.0 - decay) / speed
    return kappa + sliding * step / length, 1.0, -sliding * step / (length * length), step / length


@compiled
def response(
    law: int,
    number: float,
    shortest: float,
    curve: Array,
    speed: Array,
    wheel: Array,
    step: float,
    start: float,
    measured: Array,
    gain: float,
    tare: float,
    sliding_sd: Array,
    force_sd: float,
    held: bool,
    gains: Array,
    kappa: Array,
    force: Array,
    by: Array,
) -> None:
    """Transient slip (n,), predicted reading of the force (n,) and its derivatives `by` (n, COLUMNS) on an even grid.

    speed: of the road under the wheel (n,) [m/s]; wheel: rolling speed of the wheel (n,) [m/s]; start: transient slip at the first sample.
    measured: reading of the force (n,) [N], NaN where there is none; gain, tare: a reading is gain times force plus tare.
    sliding_sd: standard deviation of the difference of both speeds (n,) [m/s]; force_sd: of a reading [N].
    gains: Kalman gains (n,) [1/N], used as they are if `held`, else computed and written. Derivatives hold them.
    """
    moved = np.zeros(COLUMNS)
    moved[START] = 1.0
    half = np.zeros(COLUMNS)
    grad, by_force, by_slope = np.empty(8), np.empty(7), np.empty(7)
    state, variance = start, 0.0
    for k in range(speed.size):
        f, rise = force_and_slope(curve, state, by_force, by_slope)
        kappa[k], force[k] = state, gain * f + tare
        for j in range(COLUMNS):
            by[k, j] = gain * (rise * moved[j] + (by_force[j] if j < 7 else 0.0))
        by[k, GAIN] += f
        by[k, TARE] += 1.0
        if k + 1 == speed.size:
            break
        if not held:
            gains[k] = 0.0
            slope = gain * rise
            # behind the peak two slips have one force, and a correction may settle on the wrong one; errors are short there
            if variance > 0.0 and slope > 0.0 and not np.isnan(measured[k]):
                gains[k] = variance * slope / (slope * slope * variance + force_sd * force_sd)
                variance *= 1.0 - gains[k] * slope
        correction = gains[k]
        if correction != 0.0:
            state += correction * (measured[k] - force[k])
            for j in range(COLUMNS):
                moved[j] -= correction * by[k, j]
        v = 0.5 * (abs(speed[k]) + abs(speed[k + 1]))
        rolling = 0.5 * (wheel[k] + wheel[k + 1])
        sliding = rolling - 0.5 * (speed[k] + speed[k + 1])
        length = relaxation(law, number, shortest, curve, state, grad, by_slope)
        middle, by_state, by_length, by_sliding = _advance(state, length, v, sliding, 0.5 * step)
        for j in range(COLUMNS):
            of_length = grad[S_H] * moved[j] + (grad[j] if j < 8 else 0.0)
            half[j] = by_state * moved[j] + by_length * of_length
        half[SCALE] += by_sliding * rolling
        length = relaxation(law, number, shortest, curve, middle, grad, by_slope)
        state, by_state, by_length, by_sliding = _advance(state, length, v, sliding, step)
        for j in range(COLUMNS):
            of_length = grad[S_H] * half[j] + (grad[j] if j < 8 else 0.0)
            moved[j] = by_state * moved[j] + by_length * of_length
        moved[SCALE] += by_sliding * rolling
        variance = by_state * by_state * variance + (by_sliding * sliding_sd[k]) ** 2
