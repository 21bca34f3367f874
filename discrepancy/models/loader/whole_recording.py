"""A whole recording as replay inputs: for warm-up runs to its segments, and for the place where the machine drove into something."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy.model.description import Window
from discrepancy.models.loader.channels import CHANNELS, INPUTS, LIMITS, OPTIONAL, SPEEDS
from discrepancy.models.loader.contact_detection import contact_position
from discrepancy.models.loader.replay_inputs import ReplayInputs, replay_inputs
from discrepancy.models.loader.warm_up import STANDING
from discrepancy.signals.recording import Array, Recording, cleaned
from discrepancy.signals.resampling import resampled
from plant.replay import M_SPEED
from plant.sheets.machine import Machine
from plant.unit.actuators import Abilities
from plant.unit.sensor_parameters import SensorParameters

SHORTEST_S: Final = 2.0  # a shorter recording shows no contact
STANDSTILL_S: Final = 1.0  # shortest standstill that shows the zero point of a gyro


@dataclass(frozen=True, slots=True)
class WholeRecording:
    """Replay inputs over all of a recording."""

    start_s: float  # time of the first row
    inputs: ReplayInputs
    yaw_rate: Array | None  # as recorded (n,) [rad/s]; None where it was not

    def corrected_yaw_rate(self, fitted_zero: float) -> Array | None:
        """The yaw rate without the gyro's zero point: that of a standstill, else the fitted one, limited to the sheet's accuracy."""
        if self.yaw_rate is None:
            return None
        still = np.abs(self.inputs.measured[:, M_SPEED]) < STANDING
        if np.count_nonzero(still) * self.inputs.step_s > STANDSTILL_S:
            return self.yaw_rate - float(np.median(self.yaw_rate[still]))
        # limited: a fitted zero may imitate a missing effect, and would turn the dead reckoning away
        likely = CHANNELS["yaw_rate"].zero
        return self.yaw_rate - min(max(fitted_zero, -likely), likely)


def whole_recording(
    recording: Recording, like: Window, machine: Machine, sensors: SensorParameters, abilities: Abilities
) -> WholeRecording:
    """All of a recording, on the grid and with the channels of one of its windows; it has to hold all INPUTS."""
    used = [recording.signals[name] for name in INPUTS]
    start, end = max(x.time_s[0] for x in used), min(x.time_s[-1] for x in used)
    grid = start + like.step_s * np.arange(int((end - start) / like.step_s) + 1, dtype=np.float64)
    names = [n for n in (*INPUTS, *OPTIONAL, *LIMITS, *SPEEDS) if like.has(n) and n in recording.signals]
    known = {n: resampled(recording.signals[n], grid) for n in names}
    window = replace(like, start_s=float(start), end_s=float(end), time_s=grid, known=known)
    yaw_rate = recording.signals.get("yaw_rate")
    return WholeRecording(
        float(start),
        replay_inputs([window], machine, sensors, abilities),
        None if yaw_rate is None else resampled(yaw_rate, grid),
    )


def first_contact(
    recordings: Iterable[Recording],
    machine: Machine,
    sensors: SensorParameters,
    abilities: Abilities,
    step_s: float,
) -> float | None:
    """Position of the strongest contact [m] of the first recording that has one (`contact_position`); None without contact."""
    for recorded in recordings:
        recording, _ = cleaned(recorded)
        used = [recording.signals[name].time_s for name in INPUTS if name in recording.signals]
        if len(used) < len(INPUTS) or min(t.size for t in used) < 2:
            continue
        if min(t[-1] for t in used) - max(t[0] for t in used) < SHORTEST_S:
            continue
        like = Window(
            recording=recording.name,
            start_s=0.0,
            end_s=0.0,
            time_s=np.zeros(0),
            step_s=step_s,
            known=dict.fromkeys(recording.signals, np.zeros(0)),
            constants=recording.constants,
        )
        whole = whole_recording(recording, like, machine, sensors, abilities)
        found = contact_position(
            machine, whole.inputs.payload, whole.inputs.measured, step_s, whole.corrected_yaw_rate(0.0)
        )
        if found is not None:
            return found
    return None
