"""Faults in recorded samples, sizes from which they are noticed as computed, and what became of each."""

import random
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from ecu.calibration import Calibration
from ecu.detection.isolation import DRIFT, WINDOW, sensitivities
from ecu.detection.layout import CYCLES, FREEZE, JUMP, NOISE, RESIDUALS
from ecu.detection.residuals import NOTHING
from ecu.detection.rules import FAMILIES
from ecu.estimators.parameters import Parameters
from ecu.watched import COUNT, NAMES, PLACE
from studies.faults.drives import Detector, Floats, Integers

KINDS: Final = ("offset", "spike", "freeze", "drift", "noise", "swap")
SETTLE, LASTS, AFTERWARDS = 600, 300, 50
"""Ticks before a fault, of a fault, and after it in which a notice of its end is not counted against anybody."""
MULTIPLES: Final = (0.5, 1.0, 1.3, 2.0, 4.0)
"""Sizes of injected faults over the computed smallest one."""
CERTAIN = 2.0
"""Standard deviations above its threshold from which a test misses one fault in 40."""
SPIKE_EVERY = 20
PAIRS: Final[Mapping[str, str]] = {
    "wheel_speed_1": "wheel_speed_2",
    "wheel_speed_3": "wheel_speed_4",
    "wheel_torque_1": "wheel_torque_2",
    "wheel_torque_3": "wheel_torque_4",
    "pitch": "roll",
    "roll_rate": "yaw_rate",
    "specific_force_x": "specific_force_z",
    "steering_pressure_left": "steering_pressure_right",
}
"""Signals of one message that are exchanged."""
Outcome = dict[str, Any]


def smallest(
    calibration: Calibration, p: Parameters, detector: Detector, bounds: Floats, samples: Floats, place: int
) -> dict[str, tuple[float, float]]:
    """Per kind the smallest size of a fault that is noticed and how soon [s], at the median bounds of a drive.

    A jump has to pass its threshold by CERTAIN standard deviations of an innovation; a residual's mean its bound and the
    test's drift by as much as lets the sum reach its height within the fault. inf: cannot be noticed.
    """
    noise = calibration.detection.sensors[FAMILIES[NAMES[place]]].noise
    # 1.6 noise: standard deviation of an innovation against its trend (PREDICTED in ecu/detection/rules.py)
    jump = float(detector.rules[JUMP, place]) + CERTAIN * 1.6 * noise
    median = np.median(bounds, axis=0)
    speed = float(np.median(np.abs(samples[:, PLACE["wheel_speed_3"]]))) * p.wheel.unloaded_radius
    sensitive = np.zeros((RESIDUALS, COUNT))
    sensitivities(samples[len(samples) // 2], speed, p, sensitive)
    steady, after = np.inf, np.inf
    for j in range(RESIDUALS):
        # a residual that is switched off has an endless bound
        if sensitive[j, place] == 0.0 or median[j] >= NOTHING / 2.0:
            continue
        sigma = detector.rules[NOISE, j]
        # height / excess ticks until the test fires: within half of the fault
        size = (median[j] + sigma * (DRIFT + detector.height / (LASTS / 2.0))) / abs(sensitive[j, place])
        if size < steady:
            steady, after = float(size), LASTS / 200.0 + WINDOW
    still = float(detector.rules[FREEZE, place] * detector.rules[CYCLES, place]) / 100.0
    offset = (jump, 0.0) if jump <= steady else (steady, after)
    # a drift has to reach the steady size by half of its time, and the test needs the other half
    ramp = steady / (LASTS / 100.0 / 2.0)
    return {
        "offset": offset,
        "spike": (jump, 0.0),
        "freeze": (0.0, still),
        "drift": (ramp, LASTS / 100.0),
        # a normal value exceeds 1.5 standard deviations once in 7 samples: one of the ten within 0.1 s does, three
        # times in four
        "noise": (jump / 1.5, 0.1),
        "swap": (jump, 0.0),
    }


def spoilt(
    samples: Floats, heard: Integers, kind: str, place: int, size: float, generator: random.Random
) -> tuple[Floats, list[int]]:
    """The samples with a fault from SETTLE on for LASTS ticks, and the signals that are wrong."""
    found = samples.copy()
    at = slice(SETTLE, SETTLE + LASTS)
    sign = generator.choice((-1.0, 1.0))
    # messages of 20 ms: a sample stands for two cycles, and a spike lasts as long as its sample
    ticks = 2 if heard[:, place].mean() < 0.75 else 1
    came = np.flatnonzero(heard[at, place]) + SETTLE
    if kind == "offset":
        found[at, place] += sign * size
    elif kind == "drift":
        found[at, place] += sign * size * np.arange(LASTS) / 100.0
    elif kind == "spike":
        for tick in came[::SPIKE_EVERY]:
            found[tick : tick + ticks, place] += sign * size
    elif kind == "freeze":
        found[came[0] : SETTLE + LASTS, place] = found[came[0], place]
    elif kind == "noise":
        for tick in came:
            found[tick : tick + ticks, place] += generator.gauss(0.0, size)
    else:
        other = PLACE[PAIRS[NAMES[place]]]
        found[at, [place, other]] = found[at, [other, place]]
        return found, [place, other]
    return found, [place]


def try_one(
    detector: Detector,
    samples: Floats,
    heard: Integers,
    kind: str,
    place: int,
    size: float,
    generator: random.Random,
) -> Outcome | None:
    """Inject one fault at a random place of a drive and look; None where the detection had found something before."""
    begin = generator.randrange(len(samples) - SETTLE - LASTS - AFTERWARDS)
    window = slice(begin, begin + SETTLE + LASTS + AFTERWARDS)
    before, came = samples[window], heard[window]
    changed, wrong = spoilt(before, came, kind, place, size, generator)
    if kind == "swap":
        size = float(np.abs(before[SETTLE, place] - before[SETTLE, wrong[-1]]))
    modes, _ = detector.run(changed, came)
    # a false alarm before the fault: it is counted as one elsewhere, and must not count as found here
    if modes[:SETTLE].any():
        return None
    hit = np.flatnonzero(modes[SETTLE : SETTLE + LASTS].any(axis=1))
    if not len(hit):
        return {"noticed": False, "size": size}
    # what is named is read two cycles later: the two samples of slower messages do not come together
    row = modes[min(SETTLE + hit[0] + 2, SETTLE + LASTS - 1)]
    row = row if row.any() else modes[SETTLE + hit[0]]
    named = set(np.flatnonzero(row).tolist())
    return {
        "noticed": True,
        "size": size,
        "after_s": hit[0] / 100.0,
        "alone": named <= set(wrong),
        "among": bool(named & set(wrong)) and not named <= set(wrong),
    }
