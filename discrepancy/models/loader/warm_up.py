"""Warm-up runs: the replay of what precedes a segment, so that the segment starts within its motion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from discrepancy.models.loader.levelling import apart, lean
from discrepancy.models.loader.parallel import replay_segments, segment_parameters
from discrepancy.models.loader.replay_inputs import ReplayInputs
from discrepancy.signals.recording import Array
from plant.physics import state as s
from plant.physics.parameters import P_NORMAL
from plant.physics.resting import REST, height, set_height
from plant.plant import Plant
from plant.replay import M_ARTICULATION, M_LIFT, M_SPEED, M_TILT
from plant.sheets.machine import Machine
from plant.truth import columns_of

STEP_S: Final = 2.5e-3  # of the integration
WARM_UP_S: Final = (
    15.0  # initial errors must vanish: swings decay within two seconds, errors of speed within six
)
ROLLING_RADIUS: Final = 0.98  # share of the unloaded radius
UNIT: Final = 1e-3  # by which the norm of an attitude may be off
STANDING: Final = 0.02  # wheel speed below which a machine counts as standing [rad/s]


def warm_up(
    machine: Machine,
    values: Mapping[str, float],
    whole: ReplayInputs,
    rows: Sequence[int],
    equilibria: dict[int, Array],
    yaw_rate: Array | None = None,
    levelling_s: Sequence[float] = (),
) -> tuple[Array, Array]:
    """States (n, STATES) of a machine and leans (n, k) of its levelled sensors at some rows of a whole recording, after a warm-up run to each.

    values: sensor errors, as in `replay_segments`; equilibria: cache of states by row, may be shared by threads and by machines; yaw_rate: of
    the rear frame (rows of the recording,) [rad/s], if it was measured; levelling_s: time constants (k) of the sensors
    of LEVELLED. A row of which the run diverges is not a number. Raises NoEquilibriumError.

    Effects with states of their own depend on the whole past: their warm-up run starts with the recording. Without them a run of
    WARM_UP_S forgets its start, so that any machine's equilibrium will do.
    """
    whole_past = any(item.effect.own_states for item in machine.effects)
    runs = _warm_up_runs(rows, len(whole.measured) if whole_past else round(WARM_UP_S / whole.step_s))
    edges = np.cumsum([0, *(len(run) for run in runs)]).astype(np.intp)
    used = np.concatenate([np.arange(run.start, run.stop) for run in runs])
    inputs = replace(
        whole,
        measured=whole.measured[used],
        speeds={name: speed[used] for name, speed in whole.speeds.items()},
        edges=edges,
    )
    rests = [_equilibrium(machine, whole, run.start, equilibria) for run in runs]
    poses = dead_reckoning(machine, whole.measured, whole.step_s, yaw_rate)
    p = segment_parameters(machine, inputs, STEP_S)
    starts = np.stack([_at_pose(rest, poses[run.start], p) for rest, run in zip(rests, runs, strict=True)])
    states = np.empty((len(used), s.STATES))
    truth = replay_segments(machine, values, inputs, starts, np.zeros((0, REST)), STEP_S, states=states)
    felt, at = apart(columns_of(truth)), np.searchsorted(used, rows)
    # a run starts in equilibrium, and so do its sensors
    leans = np.array(
        [
            np.concatenate(
                [lean(own, own[0], time_s, whole.step_s) for own in np.split(felt[:, k], edges[1:-1])]
            )[at]
            for k, time_s in enumerate(levelling_s)
        ]
    ).T.reshape(len(rows), -1)
    arrived = np.asarray(states[at], float)
    # after a divergence on the way there is no attitude, and nothing that could be turned
    there = np.abs(np.linalg.norm(arrived[:, s.ATTITUDE : s.ATTITUDE + 4], axis=1) - 1.0) < UNIT
    arrived[~there] = np.nan
    if yaw_rate is not None:
        # unknown forces of the road turn the real machine, so the heading is that of the gyro and not that of the replay
        for i in np.flatnonzero(there).tolist():
            _turn(arrived[i], poses[rows[i], 2] - _heading(arrived[i]), p)
    return arrived, leans


def _equilibrium(machine: Machine, whole: ReplayInputs, row: int, cache: dict[int, Array]) -> Array:
    """State at the start of a warm-up run, from the cache where it is there."""
    if row in cache:
        return cache[row]
    state = equilibrium(machine, whole.payload, whole.measured[row]).inside()[0]
    if row > 0:  # a run from the first row may be short: it needs the machine's own equilibrium
        cache[row] = state
    return state


def _warm_up_runs(rows: Sequence[int], length: int) -> list[range]:
    """Row ranges that lead to each row over `length` rows, or from the first row on; overlapping ones are joined."""
    runs: list[range] = []
    for row in sorted(rows):
        first = max(row - length, 0)
        if runs and first <= runs[-1].stop:
            first = runs.pop().start
        runs.append(range(first, row + 1))
    return runs


def dead_reckoning(machine: Machine, measured: Array, step_s: float, yaw_rate: Array | None = None) -> Array:
    """Position of the joint along and across [m] and heading of the rear frame [rad] (n, 3), from the first row on.

    measured: (n, MEASURED). Without a measured yaw rate, axles are taken to roll without sideslip. A slope, or an obstacle, acts at the same place
    wherever a warm-up run starts, hence every run starts at its pose of the whole recording.
    """
    speed, angle = (
        ROLLING_RADIUS * machine.tyre.radius * measured[:, M_SPEED],
        measured[:, M_ARTICULATION],
    )
    front, rear = machine.geometry.front_axle_x, -machine.geometry.rear_axle_x
    if yaw_rate is None:
        bending = front * np.gradient(angle, step_s)
        yaw_rate = (speed * np.sin(angle) - bending) / (front + rear * np.cos(angle))
    heading = cumulative_trapezoid(yaw_rate, dx=step_s, initial=0)
    sideways = rear * yaw_rate
    along = speed * np.cos(heading) - sideways * np.sin(heading)
    across = speed * np.sin(heading) + sideways * np.cos(heading)
    position = cumulative_trapezoid([along, across], dx=step_s, initial=0)
    return np.stack([*position, heading], axis=1)


def _at_pose(state: Array, pose: Array, p: Array) -> Array:
    """A state at the origin with heading 0, moved along the road of parameters p to a pose (along, across, heading)."""
    moved, above = state.copy(), height(state, p)
    _turn(moved, pose[2], p)
    moved[s.POSITION : s.POSITION + 2] += pose[:2]
    set_height(moved, p, above)
    return moved


def _turn(state: Array, angle: float, p: Array) -> None:
    """Turn a machine and its motion about the normal of the road of parameters p, in place [rad]."""
    turn = Rotation.from_rotvec(angle * p[P_NORMAL : P_NORMAL + 3])
    state[s.ATTITUDE : s.ATTITUDE + 4] = (turn * _attitude(state)).as_quat(scalar_first=True)
    state[s.VELOCITY : s.VELOCITY + 3] = turn.apply(state[s.VELOCITY : s.VELOCITY + 3])


def _heading(state: Array) -> float:
    return float(_attitude(state).as_euler("ZYX")[0])


def _attitude(state: Array) -> Rotation:
    return Rotation.from_quat(state[s.ATTITUDE : s.ATTITUDE + 4], scalar_first=True)


def equilibrium(machine: Machine, payload: float, measured: Array) -> Plant:
    """A plant with the joint angles of a measured row (MEASURED,): at rest on its tyres, or rolling evenly. Raises NoEquilibriumError."""
    speed = float(measured[M_SPEED]) * machine.tyre.radius * ROLLING_RADIUS
    return Plant(
        machine,
        payload_mass=payload,
        speed=speed if abs(measured[M_SPEED]) > STANDING else 0.0,
        articulation_angle=_within(measured[M_ARTICULATION], -machine.steering.limit, machine.steering.limit),
        lift_arm_angle=_within(measured[M_LIFT], machine.lift.lower_limit, machine.lift.upper_limit),
        tilt_angle=_within(measured[M_TILT], machine.tilt.lower_limit, machine.tilt.upper_limit),
    )


def _within(value: float, low: float, high: float) -> float:
    return float(min(max(value, low), high))
