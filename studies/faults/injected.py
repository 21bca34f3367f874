"""Faults in recorded samples, and what became of each."""

import math
import random
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from ecu.calibration import Calibration
from ecu.detection.rules import FAMILIES
from ecu.watched import NAMES, PLACE
from studies.faults.drives import Detector, Floats, Integers
from studies.faults.sizes import sizes

KINDS: Final = ("offset", "spike", "freeze", "drift", "noise", "swap")
SETTLE, LASTS, AFTERWARDS = 600, 300, 50
"""Ticks before a fault, of a fault, and after it in which a notice of its end is not counted against anybody."""
DURING: Final = slice(SETTLE, SETTLE + LASTS)
MULTIPLES: Final = (0.5, 1.0, 1.3, 2.0, 4.0)
"""Sizes of injected faults over the computed smallest one."""
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


def try_all(
    calibration: Calibration,
    detector: Detector,
    samples: Floats,
    heard: Integers,
    place: int,
    generator: random.Random,
) -> list[Outcome]:
    """Faults of every kind and size of one signal, each at a random place of a drive that the detection takes for sound."""
    found = []
    noise = calibration.detection.sensors[FAMILIES[NAMES[place]]].noise
    for kind in KINDS:
        if kind == "swap" and NAMES[place] not in PAIRS:
            continue
        for multiple in MULTIPLES if kind not in ("freeze", "swap") else (1.0,):
            begin = generator.randrange(len(samples) - SETTLE - LASTS - AFTERWARDS)
            window = slice(begin, begin + SETTLE + LASTS + AFTERWARDS)
            sound = detector.run(samples[window], heard[window])
            # a false alarm before the fault: it is counted as one elsewhere, and must not count as found here
            if sound.modes[:SETTLE].any():
                continue
            size, soon = sizes(detector, sound, samples[window], noise, place, DURING)[kind]
            if not math.isfinite(size):
                continue
            outcome = tried(detector, samples[window], heard[window], kind, place, multiple * size, generator)
            # the size of a swap is what the two signals happen to differ by; it cannot be chosen
            share = outcome["size"] / size if kind == "swap" else multiple
            about = {"signal": NAMES[place], "kind": kind, "multiple": share, "smallest": size, "soon": soon}
            found.append(about | outcome)
    return found


def tried(
    detector: Detector,
    samples: Floats,
    heard: Integers,
    kind: str,
    place: int,
    size: float,
    generator: random.Random,
) -> Outcome:
    """Inject one fault and look what the detection says while it lasts."""
    changed, wrong = spoilt(samples, heard, kind, place, size, generator)
    if kind == "swap":
        size = float(np.abs(samples[SETTLE, place] - samples[SETTLE, wrong[-1]]))
    modes = detector.run(changed, heard).modes
    hit = np.flatnonzero(modes[DURING].any(axis=1))
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
