"""Many machines that move at the same time, LANES of them side by side: for Monte Carlo studies and sweeps of parameters.

Machines may differ in everything that a `Plant` is given. Those with the same effects go side by side; shares of them run on all processors.
"""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bus.lanes.operations import LANES
from plant.compiled import released
from plant.effects.dispatch import SWITCHES
from plant.lanes.arrays import get_lane, set_lane
from plant.lanes.kernels import SETTINGS, STEP, row_effects, row_plain, step_effects, step_plain
from plant.observer import PAYLOAD, TIME, observe
from plant.physics import state as s
from plant.physics.dynamics import advance
from plant.physics.workspace import Workspace, new_workspace
from plant.plant import Plant, steps_in
from plant.truth import Truth

Array = NDArray[np.float64]

CORES: Final = os.cpu_count() or 1


@released
def advance_in_lanes(
    states: Array,
    commands: Array,
    parameters: Array,
    step: float,
    count: int,
    work: Workspace,
    active: Array | None,
    measures: Array,
    rows: Array,
) -> None:
    """`count` steps of every machine with constant commands, and the rows of Truth at their end; all arrays have one row per machine.

    active: of every machine, with the same switches; or None. What diverges is not a number from there on.
    """
    machines, settings = states.shape[0], np.zeros(SETTINGS)
    settings[STEP] = step
    state, command = np.empty((s.STATES, LANES)), np.empty((s.COMMANDS, LANES))
    p, measure = np.empty((parameters.shape[1], LANES)), np.empty((measures.shape[1], LANES))
    row = np.empty((rows.shape[1], LANES))
    if active is not None:
        switches, values = active[0, :SWITCHES].copy(), np.empty((active.shape[1] - SWITCHES, LANES))
    for begin in range(0, machines, LANES):
        for lane in range(LANES):
            i = min(begin + lane, machines - 1)  # lanes that are left over repeat the last machine
            set_lane(state, lane, states[i])
            set_lane(command, lane, commands[i])
            set_lane(p, lane, parameters[i])
            set_lane(measure, lane, measures[i])
            if active is not None:
                set_lane(values, lane, active[i, SWITCHES:])
        for _ in range(count):
            if active is None:
                left_out = step_plain((state, command, p, settings))
            else:
                left_out = step_effects((state, command, p, settings, switches, values))
            for lane in range(LANES):
                i = begin + lane
                if left_out >> lane & 1 and i < machines and math.isfinite(state[s.POSITION, lane]):
                    get_lane(state, lane, states[i])
                    own = None if active is None else active[i]
                    advance(states[i], commands[i], parameters[i], step, 1, False, work, own)
                    set_lane(state, lane, states[i])
        if active is None:
            left_out = row_plain((row, state, command, p, measure))
        else:
            left_out = row_effects((row, state, command, p, measure, switches, values))
        for lane in range(min(LANES, machines - begin)):
            i = begin + lane
            get_lane(state, lane, states[i])
            if left_out >> lane & 1 and math.isfinite(state[s.POSITION, lane]):
                own = None if active is None else active[i]
                observe(rows[i], states[i], commands[i], parameters[i], work, own, measures[i])
            else:
                get_lane(row, lane, rows[i])


class Ensemble:
    """Machines in the states of `plants`, which stay as they are. `rows` and commands are in the order of the plants.

    Errors: ValueError where the plants' steps differ or one does not integrate semi-implicitly.
    """

    def __init__(self, plants: Sequence[Plant]) -> None:
        if not plants:
            raise ValueError("an ensemble needs at least one plant")
        steps = sorted({plant.step_s for plant in plants})
        if len(steps) > 1:
            raise ValueError(f"the plants' steps differ: {', '.join(f'{step:g} s' for step in steps)}")
        for plant in plants:
            if plant.integrator != "semi-implicit":
                raise ValueError(f"integrator={plant.integrator!r}: an ensemble is semi-implicit")
        self.step_s = steps[0]
        self.time_s = np.array([plant.time_s for plant in plants])
        """Of every machine [s]."""
        self._payloads = np.array([plant.payload_mass for plant in plants])
        inside = [plant.inside() for plant in plants]
        self._states = np.array([state for state, *_ in inside])
        self._parameters = np.array([p for _, p, *_ in inside])
        self._measures = np.array([measures for *_, measures in inside])
        self._active = [active for *_, active, _ in inside]
        self._shares = self._divided()

    def __len__(self) -> int:
        return len(self._states)

    @property
    def states(self) -> Array:
        """A copy of the plants' states (n, STATES)."""
        return self._states.copy()

    def advance(self, commands: Array, duration_s: float) -> Array:
        """Move all machines on with constant commands, and return what is true then: rows of Truth (n, Truth.size).

        commands: in the order of `Commands.vector`, (n, COMMANDS), or (COMMANDS,) for all alike. A machine that diverges has rows of NaN.
        Errors: ValueError where the duration is not a whole number of steps, or the commands are not finite or of another shape.
        """
        count = steps_in(duration_s, self.step_s)
        given = np.asarray(commands, np.float64)
        if given.shape not in ((s.COMMANDS,), (len(self), s.COMMANDS)):
            raise ValueError(
                f"commands have the shape {given.shape}, not ({len(self)}, {s.COMMANDS}) or ({s.COMMANDS},)"
            )
        if not np.isfinite(given).all():
            raise ValueError("a command is not finite")
        ordered, rows = np.broadcast_to(given, (len(self), s.COMMANDS)), np.empty((len(self), Truth.size))

        def move(share: NDArray[np.intp]) -> None:
            states, found = self._states[share], np.empty((share.size, Truth.size))
            active = None
            if self._active[share[0]] is not None:
                active = np.array([self._active[i] for i in share])
            advance_in_lanes(
                states, ordered[share], self._parameters[share], self.step_s, count, new_workspace(), active,
                self._measures[share], found,
            )  # fmt: skip
            self._states[share], rows[share] = states, found

        if len(self._shares) == 1:
            move(self._shares[0])
        else:
            with ThreadPoolExecutor(CORES) as pool:
                list(pool.map(move, self._shares))
        self.time_s += count * self.step_s
        rows[:, TIME], rows[:, PAYLOAD] = self.time_s, self._payloads
        rows[~np.isfinite(self._states[:, s.POSITION])] = math.nan
        return rows

    def _divided(self) -> list[NDArray[np.intp]]:
        """Indices of machines that go together: of the same effects, in shares of whole vectors for the processors."""
        groups: dict[bytes, list[int]] = {}
        for i, active in enumerate(self._active):
            groups.setdefault(b"" if active is None else active[:SWITCHES].tobytes(), []).append(i)
        shares = []
        for group in groups.values():
            vectors = math.ceil(len(group) / LANES)
            size = LANES * math.ceil(vectors / CORES)
            shares += [np.array(group[i : i + size], np.intp) for i in range(0, len(group), size)]
        return shares
