"""Random drives without a fault as the ECU's detection receives them, and calibrations that are wrong as real ones are."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from dbc import loader_database
from ecu.calibration import Calibration, load_calibration
from ecu.detection.detector import columns, initial
from ecu.detection.layout import RESIDUALS
from ecu.detection.rules import height_for, rules_array
from ecu.estimators.parameters import Parameters
from ecu.findings import FaultFound
from ecu.inputs import InputReceiver
from ecu.outputs import TICK_NS
from ecu.watched import COUNT, MESSAGES, NAMES
from hil.compose import lockstep
from hil.lockstep import ECU_PHASE_NS
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
    """Samples of a drive and where they came, both (n, COUNT); faults that the ECU in the loop reported."""

    samples: Floats
    heard: Integers
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
    """One drive in lockstep, with the ECU's detection in the loop."""
    recording = lockstep(scenario(seed, seconds), reference=False, detect_faults=True).run()
    samples, heard = samples_of(recording.bus, load_calibration())
    reported = tuple(str(finding) for finding in recording.ecu_findings if isinstance(finding, FaultFound))
    return Watched(samples, heard, reported)


def samples_of(frames: Sequence[Frame], calibration: Calibration) -> tuple[Floats, Integers]:
    """What the detection is given cycle by cycle, from when every input has been received."""
    # the ECU's own receiver: the detection gets what passed its checks, as in the loop
    hearing = InputReceiver(calibration, loader_database())
    rows: list[list[float]] = []
    came: list[list[bool]] = []
    waiting = iter(frames)
    frame = next(waiting, None)
    for now_ns in range(ECU_PHASE_NS, frames[-1].at_ns + TICK_NS, TICK_NS):
        while frame is not None and frame.at_ns <= now_ns:
            hearing.receive(frame, frame.at_ns)
            frame = next(waiting, None)
        received = hearing.gather(now_ns)
        if rows or not received.stale:
            rows.append([received.values[name] for name in NAMES])
            came.append([message in received.heard for message in MESSAGES])
    return np.array(rows), np.array(came, np.int64)


def wrong(p: Parameters, seed: int) -> Parameters:
    """The parameters with masses wrong by 3 %, centres of gravity by 5 cm, radii by 1 %, stiffness by 15 %."""
    generator = random.Random(f"calibration/{seed}")

    def share(bound: float) -> float:
        return 1.0 + generator.uniform(-bound, bound)

    def place() -> float:
        return generator.uniform(-0.05, 0.05)

    wheel, bucket = p.wheel, p.bucket
    return p._replace(
        front=p.front._replace(mass=p.front.mass * share(0.03), x=p.front.x + place(), z=p.front.z + place()),
        rear=p.rear._replace(mass=p.rear.mass * share(0.03), x=p.rear.x + place(), z=p.rear.z + place()),
        arm=p.arm._replace(mass=p.arm.mass * share(0.03), along=p.arm.along + place()),
        bucket=bucket._replace(
            mass=bucket.mass * share(0.03),
            forward=bucket.forward + place(),
            payload_forward=bucket.payload_forward + place(),
        ),
        wheel=wheel._replace(
            unloaded_radius=wheel.unloaded_radius * share(0.01),
            slip_stiffness=wheel.slip_stiffness * share(0.15),
            cornering_stiffness=wheel.cornering_stiffness * share(0.15),
        ),
    )


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
        self._parameters, self._tolerances = parameters, rules.tolerances
        self.rules = rules_array(rules, cycles, parameters)
        # as in the ECU (ecu/detection/live.py), whose thresholds these have to be
        self.height = height_for(rules.false_alarms / 3.0)

    def run(self, samples: Floats, heard: Integers) -> tuple[Integers, Floats]:
        """How each signal was found faulty, (n, COUNT), 0 where sound, and the residuals' bounds, (n, RESIDUALS)."""
        modes = np.zeros((len(samples), COUNT), np.int64)
        residuals, bounds = np.zeros((2, len(samples), RESIDUALS))
        columns(
            samples, heard, self._message, self._parameters, self._tolerances, self.rules, self.height, initial(),
            modes, residuals, bounds,
        )  # fmt: skip
        return modes, bounds
