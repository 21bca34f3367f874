"""One drive of the campaign: false alarms with several wrong calibrations, and faults of every signal and kind."""

import random
from dataclasses import dataclass

import numpy as np

from ecu.calibration import load_calibration
from ecu.watched import COUNT, NAMES
from studies.campaigns.batch import Result
from studies.faults.drives import Detector, drive, wrong
from studies.faults.injected import KINDS, MULTIPLES, PAIRS, smallest, try_one


@dataclass(frozen=True, slots=True)
class Case:
    """One drive of `seconds` with `calibrations` wrong calibrations and `rounds` faults of every signal and kind."""

    seed: int
    seconds: float
    calibrations: int
    rounds: int


def run(case: Case) -> Result:
    """False alarms as text, and the outcome of every fault."""
    watched = drive(case.seed, case.seconds)
    calibration = load_calibration()
    alarms = [f"in the loop: {line}" for line in watched.reported]
    # apart from the drive's generator: another number of faults must not change the drive
    generator = random.Random(f"inject/{case.seed}")
    outcomes = []
    for number in range(case.calibrations):
        parameters = wrong(calibration.parameters, 1000 * case.seed + number)
        detector = Detector(calibration, parameters)
        modes, bounds = detector.run(watched.samples, watched.heard)
        # begins only: an alarm that lasts is one alarm
        begins = np.argwhere((modes[1:] > 0) & (modes[:-1] == 0))
        alarms += [f"calibration {number}: {NAMES[k]} at {tick / 100:.2f} s" for tick, k in begins]
        # false alarms cost one pass per calibration, faults one per fault: fewer calibrations are injected under
        if number >= case.rounds:
            continue
        for place in range(COUNT):
            sizes = smallest(calibration, parameters, detector, bounds, watched.samples, place)
            for kind in KINDS:
                if kind == "swap" and NAMES[place] not in PAIRS:
                    continue
                size, soon = sizes[kind]
                for multiple in MULTIPLES if kind not in ("freeze", "swap") else (1.0,):
                    found = try_one(
                        detector, watched.samples, watched.heard, kind, place, multiple * size, generator
                    )
                    if found is not None:
                        # the size of a swap is what the two signals happen to differ by; it cannot be chosen
                        share = found["size"] / size if kind == "swap" else multiple
                        outcomes.append(
                            {
                                "signal": NAMES[place],
                                "kind": kind,
                                "multiple": share,
                                "smallest": size,
                                "soon": soon,
                            }
                            | found
                        )
    return {
        "seed": case.seed,
        "hours": len(watched.samples) / 360_000.0,
        "alarms": alarms,
        "outcomes": outcomes,
    }
