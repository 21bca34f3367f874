"""Initial states of the segments of one recording, and the replay from them up to the quantities that sensors measure."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from discrepancy.models.loader.channels import CHANNELS, LEVELLED, felt
from discrepancy.models.loader.initial_states import changed_starts
from discrepancy.models.loader.machine_variant import Variants
from discrepancy.models.loader.parallel import replay_segments, segment_parameters
from discrepancy.models.loader.replay_inputs import ReplayInputs
from discrepancy.signals.recording import Array
from plant.effects import dispatch
from plant.effects.registry import python_hook
from plant.physics import state as s
from plant.physics.workspace import new_workspace
from plant.truth import Truth, columns_of

ABSURD: Final = 1e3  # largest output of a motion that diverged, in typical errors of its channel: bad enough to reject the step, finite for the algebra
JOINT_ZEROS: Final = (
    (s.FRONT_FRAME, "articulation_zero"),
    (s.LIFT_ARM, "lift_zero"),
    (s.BUCKET, "tilt_zero"),
)
"""Joints whose measured angle has a zero point: body, nuisance."""


@dataclass(frozen=True, slots=True)
class WindowStart:
    """Inputs and initial states of the segments of one recording."""

    inputs: ReplayInputs
    starts: Array  # states after the warm-up runs (n, STATES)
    rests: Array  # equilibria of the machine of the warm-up runs at these states (n, REST), see plant.physics.resting
    leans: Array  # of the levelled sensors (n, LEVELLED) [rad], by the accelerations before these states
    warm_up_values: Mapping[str, float]  # parameters of the machine of the warm-up runs
    step_error: Mapping[str, Array] = field(
        default_factory=dict
    )  # by output, what long integration steps miss


def true_outputs(
    variants: Variants, start: WindowStart, values: Mapping[str, float], step_s: float
) -> dict[str, Array]:
    """Every output before its sensor, one segment after the other, by a replay in steps of step_s."""
    machine = variants.having(values)
    starts, rests = start.starts.copy(), start.rests.copy()
    for body, name in JOINT_ZEROS:  # a warm-up run subtracts its own zero points from the measured angles
        starts[:, s.JOINT + body] += start.warm_up_values.get(name, 0.0) - values.get(name, 0.0)
    if any(python_hook(item.effect, "start") is not None for item in machine.effects):
        p, work = segment_parameters(machine, start.inputs, step_s), new_workspace()
        for state in starts:
            dispatch.start(machine.effects, state, p, work)
    starts, rests, inputs = changed_starts(values, starts, rests, start.inputs, machine.tyre.radius)
    rows = replay_segments(machine, values, inputs, starts, rests, step_s)
    rows[:, Truth.payload_mass.at] = inputs.payload  # the compiled record leaves it out
    found, columns = {}, columns_of(rows)
    for name, channel in CHANNELS.items():
        quantity, index = channel.columns
        true = columns[quantity] if index is None else columns[quantity][:, index]
        most = ABSURD * channel.typical
        found[name] = np.fmin(np.fmax(true, -most), most)  # NaN of a diverged motion becomes -most
    for name, (quantity, index) in LEVELLED.items():
        taken, most = columns[quantity][:, index], ABSURD * CHANNELS[name].typical
        found[felt(name)] = np.fmin(np.fmax(taken, -most), most)
    return found
