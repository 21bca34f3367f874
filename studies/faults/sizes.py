"""The smallest size of a fault that is noticed, computed from the thresholds and bounds in force while it lasts.

A jump has to pass its sample's threshold. Below it the fault has to move a residual: its response to the fault, by the
residual's own equation, less its bound has to carry the sequential test to its height before the fault is over.
"""

import numpy as np

from ecu.detection.isolation import DRIFT, WINDOW, sensitivities
from ecu.detection.jumps import EXPLAINED
from ecu.detection.layout import (
    ACROSS,
    ALONG,
    ANGLE_RATE,
    CYCLES,
    FREEZE,
    NOISE,
    PITCH_GYRO,
    RESIDUALS,
    ROLL_GYRO,
    STEERING_LINES,
    UPWARDS,
)
from ecu.detection.machine import NOTHING, OBSERVED
from ecu.detection.residuals import SLOW
from ecu.detection.rules import PREDICTED
from ecu.watched import ANGLE, COUNT, FORCE, LEFT_LINE, PITCH, PLACE, RIGHT_LINE, ROLL
from studies.faults.drives import Detector, Floats, Judged

CERTAIN = 2.0
"""Standard deviations above its threshold from which a test misses one fault in 40."""
TICK_S = 0.01
APART = 1e6
"""Of two steering lines, so that a fault of the lower one leaves it the lower one [Pa]."""
OBSERVERS = {ANGLE_RATE: ANGLE, ROLL_GYRO: ROLL, PITCH_GYRO: PITCH}
FILTERED = (ALONG, ACROSS, UPWARDS)
LARGEST = 1e12


def jump_size(detector: Detector, judged: Judged, noise: float, place: int, tick: int) -> float:
    """Of a jump that begins at `tick`: the threshold while others may explain it, and what noise may take away."""
    waits = slice(tick, tick + round(EXPLAINED / TICK_S) + 2)
    threshold = float(judged.thresholds[waits, place].max())
    return threshold + CERTAIN * PREDICTED * noise if threshold < NOTHING else np.inf


def response(residual: int, place: int, fault: Floats) -> Floats:
    """How a residual answers to a fault of one of its signals, for a sensitivity of one; fault: (n,), SI."""
    found = np.array(fault, dtype=float)
    if residual in OBSERVERS:
        # the observer forgets an offset of the angle, and adds up one of the rate
        observed = 0.0
        for i, value in enumerate(fault):
            angle, rate = (value, 0.0) if place == OBSERVERS[residual] else (0.0, value)
            observed += rate * TICK_S + TICK_S / OBSERVED * (angle - observed)
            found[i] = angle - observed
    elif residual in FILTERED:
        filtered = 0.0
        for i, value in enumerate(fault):
            filtered += TICK_S / (SLOW + TICK_S) * (value - filtered)
            found[i] = filtered
    return found


def steady_size(
    detector: Detector, judged: Judged, samples: Floats, place: int, at: slice, fault: Floats
) -> tuple[float, float]:
    """Smallest factor on a fault of shape `fault` that a residual's test notices during `at`, and how soon [s]."""
    sensitive = np.zeros((RESIDUALS, COUNT))
    speed = float(samples[at.start, PLACE["wheel_speed_3"]]) * detector.radius
    sensitivities(samples[at.start], speed, detector.parameters, sensitive)
    least, soon = np.inf, np.inf
    for j in map(int, np.flatnonzero(sensitive[:, place])):
        bound = judged.bounds[at, j]
        says = bound < NOTHING
        if j == STEERING_LINES and not _lower(samples[at], place):
            continue
        if j in (ROLL_GYRO, PITCH_GYRO) and FORCE <= place < FORCE + 3:
            continue  # their bounds hold what accelerometers add to a slope
        # offsets of sound sensors may be against the fault
        carried = abs(float(judged.residuals[at, j][says].mean())) if says.any() else 0.0
        bound, sigma = np.where(says, bound + carried, bound), detector.rules[NOISE, j]
        shape = np.abs(sensitive[j, place]) * np.abs(response(j, place, fault))
        size = _bisected(shape, bound, sigma, detector.height)
        if size < least:
            total = _sums(size * 1.001 * shape, bound, sigma)
            least, soon = size, float(np.argmax(total > detector.height)) * TICK_S
    return least, soon


def _lower(samples: Floats, place: int) -> bool:
    """Whether the line stays the lower one of the two: what is added to the higher one changes no residual."""
    lines = samples[:, [LEFT_LINE, RIGHT_LINE]]
    return bool((samples[:, place] < lines.max(axis=1) - APART).mean() > 0.8)


def _sums(shape: Floats, bound: Floats, sigma: float) -> Floats:
    """The sequential test's sum, (n,); it begins anew where the residual says nothing."""
    steps = np.where(bound < NOTHING, (shape - bound) / sigma - DRIFT, -LARGEST)
    steps[len(steps) - round(WINDOW / TICK_S) - 1 :] = -LARGEST  # what fires then is named too late
    added = np.cumsum(steps)
    return added - np.minimum.accumulate(np.minimum(added, 0.0))


def _bisected(shape: Floats, bound: Floats, sigma: float, height: float) -> float:
    """The smallest factor on `shape` with which the test reaches its height."""
    says = bound < NOTHING
    if not (says & (shape > 0.0)).any():
        return np.inf
    low, high = 0.0, 1.0
    most = 1e3 * (bound[says].max() + height * sigma) / shape[says & (shape > 0.0)].max()
    while _sums(high * shape, bound, sigma).max() <= height:
        low, high = high, 2.0 * high
        if high > most:
            return np.inf
    while high - low > 0.01 * high:
        middle = (low + high) / 2.0
        if _sums(middle * shape, bound, sigma).max() > height:
            high = middle
        else:
            low = middle
    return high


def still_time(detector: Detector, place: int) -> float:
    """After which time a signal that stands still is noticed [s]."""
    return float(detector.rules[FREEZE, place] * detector.rules[CYCLES, place]) * TICK_S


def sizes(
    detector: Detector, judged: Judged, samples: Floats, noise: float, place: int, at: slice
) -> dict[str, tuple[float, float]]:
    """Per kind the smallest size of a fault during `at` that is noticed, and how soon [s]. inf: cannot be noticed.

    noise: standard deviation of the signal's sensor. Drift per second, noise as its standard deviation.
    """
    jump = jump_size(detector, judged, noise, place, at.start)
    ticks = at.stop - at.start
    offset, after = steady_size(detector, judged, samples, place, at, np.ones(ticks))
    ramp, reached = steady_size(detector, judged, samples, place, at, np.arange(ticks) * TICK_S)
    explained = EXPLAINED
    return {
        "offset": (jump, explained) if jump <= offset else (offset, after),
        "spike": (jump, explained),
        "freeze": (0.0, still_time(detector, place)),
        "drift": (ramp, reached),
        # a normal value exceeds 1.5 standard deviations once in 7 samples: one of the ten within 0.1 s does, three
        # times in four
        "noise": (jump / 1.5, explained),
        "swap": (jump, explained),
    }
