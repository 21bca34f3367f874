"""Drives without a fault as the ECU's detection receives them, and the detection over them."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from dbc import loader_database
from ecu.calibration import Calibration, load_calibration
from ecu.cycle import EcuCycle
from ecu.detection.detector import columns, initial
from ecu.detection.layout import NO_SAMPLE, REJECTED, RESIDUALS, SAMPLE
from ecu.detection.machine import effective_radius
from ecu.detection.rules import height_for, rules_array
from ecu.estimators.parameters import Parameters
from ecu.findings import FaultFound
from ecu.inputs import CycleInputs, InputReceiver
from ecu.outputs import TICK_NS
from ecu.watched import COUNT, MESSAGES, NAMES
from hil.compose import calibration_of, plant_unit
from hil.lockstep import ECU_PHASE_NS, Lockstep
from plant.physics.surface import Surface
from plant.unit.scenario import Scenario, load_scenario
from studies.soak import chance
from studies.soak.detection_matrix import DRIVE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
FRICTION, GRADE, BANK_DEG = (0.35, 0.9), 0.08, 4.0
SLOPING = 0.6
"""Share of the drives that are not on a level dry road."""


@dataclass(frozen=True, slots=True)
class Watched:
    """What the detection was given in a drive, and the faults that the ECU in the loop reported."""

    samples: Floats  # (n, COUNT)
    heard: Integers  # what came of each signal (`ecu.detection.layout`), (n, COUNT)
    usable: Floats  # 0 where other checks reject the signal, (n, COUNT)
    reported: tuple[str, ...]


def scenario(seed: int, seconds: float) -> Scenario:
    """A random drive with random payload, ground, and offsets of the sensors within their make's."""
    generator = random.Random(f"faults/{seed}")
    base = load_scenario(DRIVE)
    sensors = base.equipment.sensors
    channels = {
        name: replace(
            channel,
            # within what the data sheet permits: a sound sensor may have any of these offsets
            bias=channel.bias * generator.uniform(-1.0, 1.0),
            scale_error=channel.scale_error * generator.uniform(-1.0, 1.0),
        )
        for name, channel in sensors.channels.items()
    }
    # drawn also where it is not used: the numbers that follow then do not depend on it
    ground = Surface(
        friction=generator.uniform(*FRICTION),
        grade=math.atan(generator.uniform(-GRADE, GRADE)),
        bank=math.radians(generator.uniform(-BANK_DEG, BANK_DEG)),
    )
    return replace(
        base,
        duration_s=seconds,
        payload_mass=generator.uniform(0.0, 3200.0),
        script=chance.drive(generator, seconds),
        start=replace(base.start, speed=0.0),
        surface=ground if generator.random() < SLOPING else Surface(),
        equipment=replace(base.equipment, sensors=replace(sensors, channels=channels)),
        seed=generator.randrange(2**32),
    )


def drive(seed: int, seconds: float) -> Watched:
    """One random drive."""
    return driven(scenario(seed, seconds))


def driven(chosen: Scenario, calibration: Calibration | None = None) -> Watched:
    """One drive in lockstep, with the ECU's detection in the loop; by the machine's own calibration where None is given."""
    calibration = calibration or load_calibration(calibration_of(chosen))
    recording = Lockstep(plant_unit(chosen), EcuCycle(calibration, detect_faults=True), reference=False).run()
    samples, heard, usable = samples_of(recording.bus, calibration)
    reported = tuple(str(finding) for finding in recording.ecu_findings if isinstance(finding, FaultFound))
    return Watched(samples, heard, usable, reported)


def samples_of(frames: Sequence[Frame], calibration: Calibration) -> tuple[Floats, Integers, Floats]:
    """What the detection is given cycle by cycle, from when every input has been received: samples, heard, usable."""
    # the ECU's own receiver: the detection gets what passed its checks, as in the loop
    hearing = InputReceiver(calibration, loader_database())
    rows: list[list[float]] = []
    came: list[list[int]] = []
    usable: list[list[bool]] = []
    waiting = iter(frames)
    frame = next(waiting, None)
    for now_ns in range(ECU_PHASE_NS, frames[-1].at_ns + TICK_NS, TICK_NS):
        while frame is not None and frame.at_ns <= now_ns:
            hearing.receive(frame, frame.at_ns)
            frame = next(waiting, None)
        received = hearing.gather(now_ns)
        if rows or not received.stale:
            rows.append([received.values[name] for name in NAMES])
            came.append(
                [_came(received, name, message) for name, message in zip(NAMES, MESSAGES, strict=True)]
            )
            usable.append([name not in received.unusable for name in NAMES])
    return np.array(rows), np.array(came, np.int64), np.array(usable, float)


def _came(received: CycleInputs, name: str, message: str) -> int:
    """As in the live loop."""
    if message not in received.heard:
        return NO_SAMPLE
    if name in received.stepped:
        return REJECTED
    return NO_SAMPLE if name in received.unusable else SAMPLE


@dataclass(frozen=True, slots=True)
class Judged:
    """What the detection says of a recording, cycle by cycle."""

    modes: Integers  # how each signal was found faulty, (n, COUNT), 0 where sound
    thresholds: Floats  # innovation from which on a sample is a jump, (n, COUNT)
    residuals: Floats  # (n, RESIDUALS)
    bounds: Floats  # likewise

    def begins(self) -> list[tuple[int, int]]:
        """Cycle and place of every signal that turned faulty."""
        turned = np.argwhere((self.modes[1:] > 0) & (self.modes[:-1] == 0))
        return [(int(cycle) + 1, int(place)) for cycle, place in turned]


class Detector:
    """The detection over whole recordings, with one calibration."""

    def __init__(self, calibration: Calibration, parameters: Parameters) -> None:
        rules, database = calibration.detection, loader_database()
        cycles = {
            name: database.by_name[message].cycle_ns / TICK_NS
            for name, message in zip(NAMES, MESSAGES, strict=True)
        }
        numbers = list(dict.fromkeys(MESSAGES))
        self._message = np.array([numbers.index(message) for message in MESSAGES])
        self.parameters, self._tolerances = parameters, rules.tolerances
        self.radius = effective_radius(parameters)
        self.rules = rules_array(rules, cycles, parameters)
        # as in the ECU (ecu/detection/live.py), whose thresholds these have to be
        self.height = height_for(rules.false_alarms / 3.0)

    def run(self, samples: Floats, heard: Integers, usable: Floats | None = None) -> Judged:
        """The detection from its start; arguments as in `Watched`, all signals usable where None is given."""
        n = len(samples)
        usable = np.ones((n, COUNT)) if usable is None else usable
        found = Judged(
            np.zeros((n, COUNT), np.int64),
            np.zeros((n, COUNT)),
            np.zeros((n, RESIDUALS)),
            np.zeros((n, RESIDUALS)),
        )
        columns(
            samples, heard, usable, self._message, self.parameters, self._tolerances, self.rules, self.height, initial(),
            found.modes, found.thresholds, found.residuals, found.bounds,
        )  # fmt: skip
        return found
