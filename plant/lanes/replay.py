"""Measurement-driven replay of many segments, LANES of them at once: the same as `plant.replay.replay`, to rounding.

A lane whose segment is at its end takes the next one. A lane without one goes along with the first that has one, so that its numbers stay those of a machine.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bus.lanes.operations import LANES
from plant.compiled import released
from plant.effects.dispatch import SWITCHES
from plant.lanes.arrays import get_lane, repeated, set_lane
from plant.lanes.kernels import (
    DEMANDED,
    INTERVAL,
    SETTINGS,
    SHARE,
    STEP,
    command_lanes,
    draw_lanes,
    row_effects,
    row_plain,
    step_effects,
    step_plain,
)
from plant.observer import TIME, observe
from plant.physics import state as s
from plant.physics.dynamics import advance
from plant.physics.parameters import P_WHEELS, W_RADIUS
from plant.physics.resting import moved_to_rest
from plant.physics.workspace import Workspace
from plant.replay import GAIN, MEASURED, Demanded, draw, exact_servos

Array = NDArray[np.float64]


@released
def replay_in_lanes(
    starts: Array,
    rests: Array,
    measured: Array,
    edges: NDArray[np.intp],
    p: Array,
    demanded: Demanded,
    step: float,
    count: int,
    work: Workspace,
    active: Array | None,
    measures: Array,
    rows: Array,
    states: Array,
) -> None:
    """Arguments as of `plant.replay.replay`."""
    segments, radius = edges.size - 1, p[P_WHEELS + W_RADIUS]
    interval = count * step
    exact = exact_servos(p, step)
    p_lanes, exact_lanes, measures_lanes = repeated(p), repeated(exact), repeated(measures)
    state, command = np.zeros((s.STATES, LANES)), np.zeros((s.COMMANDS, LANES))
    now, after = np.zeros((MEASURED, LANES)), np.zeros((MEASURED, LANES))
    row = np.zeros((rows.shape[1], LANES))
    settings = np.zeros(SETTINGS)
    settings[STEP], settings[INTERVAL], settings[SHARE] = step, interval, GAIN * interval
    for joint in range(3):
        settings[DEMANDED + joint] = 1.0 if demanded[joint] else 0.0
    if active is not None:
        switches, values = active[:SWITCHES].copy(), repeated(active[SWITCHES:])
    alone, ordered = np.empty(s.STATES), np.empty(s.COMMANDS)
    segment, at = np.full(LANES, -1), np.zeros(LANES, np.intp)
    waiting = 0  # the first segment that no lane has taken yet
    while True:
        first = -1
        for lane in range(LANES):
            ended = segment[lane] >= 0 and (
                at[lane] == edges[segment[lane] + 1] or not math.isfinite(state[s.POSITION, lane])
            )
            if (segment[lane] < 0 or ended) and waiting < segments:
                segment[lane], at[lane] = waiting, edges[waiting]
                alone[:] = starts[waiting]
                if rests.shape[0] > 0:
                    moved_to_rest(alone, rests[waiting], p, work, active)
                    draw(alone, measured[at[lane]], radius, 1.0)
                set_lane(state, lane, alone)
                # the last command of another segment would act on the accelerations of the first row
                command[:, lane] = 0.0
                waiting += 1
            elif ended:
                segment[lane] = -1
            if segment[lane] >= 0 and first < 0:
                first = lane
        if first < 0:
            break
        for lane in range(LANES):
            like = lane if segment[lane] >= 0 else first
            k, end = at[like], edges[segment[like] + 1]
            set_lane(now, lane, measured[k])
            set_lane(after, lane, measured[min(k + 1, end - 1)])
            if like != lane:
                state[:, lane], command[:, lane] = state[:, like], command[:, like]
            elif states.shape[0] > 0:
                get_lane(state, lane, states[k])
        if active is None:
            left_out = row_plain((row, state, command, p_lanes, measures_lanes))
        else:
            left_out = row_effects((row, state, command, p_lanes, measures_lanes, switches, values))
        for lane in range(LANES):
            if segment[lane] >= 0:
                k = at[lane]
                if left_out >> lane & 1:
                    get_lane(state, lane, alone)
                    get_lane(command, lane, ordered)
                    observe(rows[k], alone, ordered, p, work, active, measures)
                else:
                    get_lane(row, lane, rows[k])
                rows[k, TIME] = (k - edges[segment[lane]]) * interval
        command_lanes((command, state, now, after, p_lanes, settings))
        for _ in range(count):
            if active is None:
                left_out = step_plain((state, command, exact_lanes, settings))
            else:
                left_out = step_effects((state, command, exact_lanes, settings, switches, values))
            for lane in range(LANES):
                if left_out >> lane & 1 and segment[lane] >= 0:
                    get_lane(state, lane, alone)
                    get_lane(command, lane, ordered)
                    advance(alone, ordered, exact, step, 1, False, work, active)
                    set_lane(state, lane, alone)
        draw_lanes((state, after, p_lanes, settings))
        at += 1
