"""The campaign's cases: random drives with faults injected, hard manoeuvres and the drive cases without any."""

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ecu.calibration import Calibration, load_calibration
from ecu.detection.rules import FAMILIES
from ecu.watched import COUNT, NAMES
from hil.compose import calibration_of
from plant.unit.scenario import Scenario, load_scenario
from studies.campaigns.batch import Result
from studies.campaigns.manoeuvres import Manoeuvre, scenario_of
from studies.campaigns.wrong_calibration import wrong_calibration, wrong_parameters
from studies.faults.drives import Detector, Judged, Watched, driven, scenario
from studies.faults.injected import LASTS, try_all
from studies.faults.sizes import sizes

WARM = 200
"""Ticks after which every residual says something."""
APART_S = {"random": 15.0, "hard": 1.0}
"""Between two moments at which the smallest sizes are computed."""


@dataclass(frozen=True, slots=True)
class Case:
    """A random drive of `seconds`, with `calibrations` wrong calibrations and `rounds` faults of every signal and kind."""

    seed: int
    seconds: float
    calibrations: int
    rounds: int


@dataclass(frozen=True, slots=True)
class Hard:
    """A manoeuvre of the campaign on prevention, or a drive case by its name with a seed of the sensors' noise."""

    number: int
    calibrations: int
    manoeuvre: Manoeuvre | None = None
    name: str = ""
    seed: int = 0


def run(case: Case) -> Result:
    """A random drive: false alarms as text, what became of every fault, and computed sizes."""
    watched, calibration = driven(scenario(case.seed, case.seconds)), load_calibration()
    # apart from the drive's generator: another number of faults must not change the drive
    generator = random.Random(f"inject/{case.seed}")
    alarms = [f"in the loop: {line}" for line in watched.reported]
    outcomes, least = [], {}
    for number, detector in enumerate(_detectors(calibration, case.calibrations, case.seed)):
        judged = detector.run(watched.samples, watched.heard, watched.usable)
        alarms += _alarms(judged, number)
        if number == 0:
            least = _sizes(calibration, detector, judged, watched, APART_S["random"])
        # false alarms cost one pass per calibration, faults one per fault: fewer calibrations are injected under
        if 0 < number <= case.rounds:
            for place in range(COUNT):
                outcomes += try_all(calibration, detector, watched.samples, watched.heard, place, generator)
    return _result(f"random drive, seed {case.seed}", "random", watched, alarms, least) | {
        "outcomes": outcomes
    }


def run_hard(case: Hard) -> Result:
    """A hard drive: false alarms and computed sizes."""
    drive, calibration = _hard(case)
    watched = driven(drive, calibration)
    right = load_calibration(calibration_of(drive))
    alarms = [f"in the loop: {line}" for line in watched.reported]
    least: Mapping[str, list[float]] = {}
    for number, detector in enumerate(_detectors(right, case.calibrations, 7_000_000 + case.number)):
        judged = detector.run(watched.samples, watched.heard, watched.usable)
        alarms += _alarms(judged, number)
        if number == 0:
            least = _sizes(right, detector, judged, watched, APART_S["hard"])
    kind = case.manoeuvre.kind if case.manoeuvre else "drive case"
    what = (
        f"manoeuvre {case.number}, {kind}" if case.manoeuvre else f"drive case {case.name}, seed {case.seed}"
    )
    return _result(what, kind, watched, alarms, least)


def _hard(case: Hard) -> tuple[Scenario, Calibration]:
    """The drive and the calibration of the ECU in the loop: a manoeuvre brings its own."""
    if case.manoeuvre is None:
        drive = replace(load_scenario(case.name), seed=case.seed)
        return drive, load_calibration(calibration_of(drive))
    drive = scenario_of(case.manoeuvre)
    seed, name = case.manoeuvre.calibration_seed, calibration_of(drive)
    return drive, load_calibration(name) if seed is None else wrong_calibration(name, seed)


def _detectors(calibration: Calibration, wrong: int, seed: int) -> list[Detector]:
    """With the right parameters first, then with wrong ones."""
    found = [Detector(calibration, calibration.parameters)]
    for number in range(wrong):
        draw = random.Random(1000 * seed + number)
        found.append(Detector(calibration, wrong_parameters(calibration.parameters, draw)))
    return found


def _alarms(judged: Judged, number: int) -> list[str]:
    name = f"wrong calibration {number}" if number else "right calibration"
    return [f"{name}: {NAMES[place]} at {tick / 100:.2f} s" for tick, place in judged.begins()]


def _sizes(
    calibration: Calibration, detector: Detector, judged: Judged, watched: Watched, apart_s: float
) -> dict[str, list[float]]:
    """The smallest noticeable offset of every signal, moment by moment."""
    found: dict[str, list[float]] = {name: [] for name in NAMES}
    for begin in range(WARM, len(watched.samples) - LASTS, round(100 * apart_s)):
        at = slice(begin, begin + LASTS)
        for place, name in enumerate(NAMES):
            noise = calibration.detection.sensors[FAMILIES[name]].noise
            found[name].append(sizes(detector, judged, watched.samples, noise, place, at)["offset"][0])
    return found


def _result(
    what: str, kind: str, watched: Watched, alarms: list[str], least: Mapping[str, list[float]]
) -> Result:
    return {
        "what": what,
        "kind": kind,
        "hours": len(watched.samples) / 360_000.0,
        "alarms": alarms,
        "sizes": {name: [float(np.float32(size)) for size in found] for name, found in least.items()},
        "outcomes": [],
    }
