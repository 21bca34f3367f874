"""Replay of many segments at once: the segments are divided among the processors, each share is one call of compiled code."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.models.loader.replay_inputs import ReplayInputs, without_sensor_errors
from discrepancy.signals.recording import Array
from plant import replay as plant_replay
from plant.effects import dispatch
from plant.lanes.replay import replay_in_lanes
from plant.observer import Observer
from plant.physics import state as s
from plant.physics.parameters import parameter_vector
from plant.physics.surface import Surface
from plant.physics.workspace import new_workspace
from plant.sheets.machine import Machine
from plant.truth import Truth

CORES: Final = os.cpu_count() or 1


def segment_parameters(machine: Machine, inputs: ReplayInputs, step_s: float) -> Array:
    """The plant's parameter vector for a replay of these inputs in steps of step_s."""
    return plant_replay.replay_parameters(
        parameter_vector(machine, Surface(), inputs.payload), step_s, demanded=inputs.demanded
    )


def replay_segments(
    machine: Machine,
    values: Mapping[str, float],
    inputs: ReplayInputs,
    starts: Array,
    rests: Array,
    step_s: float,
    *,
    states: Array | None = None,
) -> Array:
    """Rows of Truth (n, Truth.size) of a machine driven by measured inputs; fills `states` (n, STATES) with those of the plant.

    values: sensor errors to correct the inputs for; starts, rests: initial state and rest of every segment as in plant.replay.replay;
    step_s: of the integration. Where the motion diverges, the remaining rows of the segment are NaN.
    """
    p, active = segment_parameters(machine, inputs, step_s), dispatch.active_vector(machine.effects)
    measures = Observer(machine, inputs.payload).measures
    measured = without_sensor_errors(inputs, values)
    rows = np.full((len(measured), Truth.size), np.nan)
    if states is not None:
        states[:] = np.nan
    none = np.zeros((0, s.STATES))

    def replay(first: int, last: int) -> None:
        edges = inputs.edges[first : last + 1]
        own = slice(edges[0], edges[-1])
        # also one segment alone, so that the results do not depend on the number of processors
        replay_in_lanes(
            starts[first:last],
            rests[first:last],
            measured[own],
            edges - edges[0],
            p,
            inputs.demanded,
            step_s,
            round(inputs.step_s / step_s),
            new_workspace(),
            active,
            measures,
            rows[own],
            none if states is None else states[own],
        )

    def replay_share(first: int, last: int) -> None:
        try:
            replay(first, last)
        except np.linalg.LinAlgError:
            # One segment diverged until its equations had no solution. The others of the share are replayed one by one.
            for segment in range(first, last) if last - first > 1 else ():
                replay_share(segment, segment + 1)

    with ThreadPoolExecutor(CORES) as pool:
        list(pool.map(replay_share, *shares(inputs.edges, CORES)))
    return rows


def shares(edges: NDArray[np.intp], count: int) -> tuple[list[int], list[int]]:
    """First and end index of `count` groups of segments of about equal length; fewer groups where there are fewer segments."""
    wanted = np.linspace(edges[0], edges[-1], count + 1)
    cuts = np.unique([int(np.argmin(np.abs(edges - row))) for row in wanted]).tolist()
    return cuts[:-1], cuts[1:]
