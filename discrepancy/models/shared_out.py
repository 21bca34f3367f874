"""Stretches that are led one by one, shared out among the processors: each share one call of compiled code."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.models.leading import Speeds, shifted
from discrepancy.recording import Array
from plant import state as s
from plant.effects import dispatch
from plant.follow import Asked, lead, led_parameters
from plant.machine import Machine
from plant.parameters import parameter_vector
from plant.surface import Surface
from plant.truth import Observer, Truth
from plant.workspace import new_workspace

CORES: Final = os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class Way:
    """What leads through stretches of one recording, one after the other, as it was measured every step_s.

    speeds: of the wheels; edges: rows where stretches begin, and their end; asked: which joints' rates are those asked for.
    """

    measured: Array
    speeds: Speeds
    edges: NDArray[np.intp]
    asked: Asked
    payload: float
    step_s: float


def parameters_of(machine: Machine, way: Way, step_s: float) -> Array:
    """The parameter vector of a machine led along a way in steps of step_s."""
    return led_parameters(parameter_vector(machine, Surface(), way.payload), step_s, asked=way.asked)


def led(
    machine: Machine,
    values: Mapping[str, float],
    way: Way,
    starts: Array,
    rests: Array,
    step_s: float,
    *,
    states: bool = False,
) -> Array:
    """Rows of Truth (n, Truth.size), or the plant's states (n, STATES), of a machine led along a way in steps of step_s.

    values: by which sensors are taken to be off; starts, rests: as in plant.follow.lead. Where the motion diverged rows are not numbers.
    """
    p, active = parameters_of(machine, way, step_s), dispatch.active_vector(machine.effects)
    measures = Observer(machine, way.payload).measures
    measured = shifted(way.measured, way.speeds, way.edges, values, way.step_s)
    rows = np.full((len(measured), Truth.size), np.nan)
    seen = np.full((len(measured) if states else 0, s.STATES), np.nan)

    def lead_part(first: int, last: int) -> None:
        try:
            lead_all(first, last)
        except (
            np.linalg.LinAlgError
        ):  # a motion has diverged beyond what can be solved; its rows stay as they are
            for stretch in range(first, last) if last - first > 1 else ():
                lead_part(stretch, stretch + 1)

    def lead_all(first: int, last: int) -> None:
        edges = way.edges[first : last + 1]
        own = slice(edges[0], edges[-1])
        lead(
            starts[first:last],
            rests[first:last],
            measured[own],
            edges - edges[0],
            p,
            way.asked,
            step_s,
            round(way.step_s / step_s),
            new_workspace(),
            active,
            measures,
            rows[own],
            seen[own] if states else seen,
        )

    with ThreadPoolExecutor(CORES) as pool:
        list(pool.map(lead_part, *_shares(way.edges, CORES)))
    return seen if states else rows


def _shares(edges: NDArray[np.intp], count: int) -> tuple[list[int], list[int]]:
    """Where `count` runs of whole stretches of about equal length begin and end; fewer where there are fewer stretches."""
    wanted = np.linspace(edges[0], edges[-1], count + 1)
    cuts = np.unique([int(np.argmin(np.abs(edges - row))) for row in wanted]).tolist()
    return cuts[:-1], cuts[1:]
