"""The function of the loader's model: a measurement-driven replay of many segments at once, with any parameters and effects.

A warm-up run through what precedes a segment gives its initial state. Its machine has the parameters of Window.warm_up, else those of the
sheet. A machine with other values starts from the same motion, shifted by the difference of the two equilibria (plant.physics.resting).
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from threading import Lock
from typing import Final

import numpy as np
from scipy.signal import lfilter

from discrepancy.model.description import Window
from discrepancy.model.sensors import delayed
from discrepancy.models.loader.channels import CHANNELS, LEVELLED, SPEEDS, felt
from discrepancy.models.loader.levelling import lean
from discrepancy.models.loader.machine_variant import Variants
from discrepancy.models.loader.nuisances import BODIES, NUISANCES, scale, zero
from discrepancy.models.loader.parallel import segment_parameters
from discrepancy.models.loader.replay_inputs import SPEED_FAULTS, ReplayInputs, kept_share, replay_inputs
from discrepancy.models.loader.warm_up import STANDING, equilibrium, warm_up
from discrepancy.models.loader.whole_recording import WholeRecording, first_contact, whole_recording
from discrepancy.models.loader.window_start import WindowStart, true_outputs
from discrepancy.signals.recording import Array, Recording
from plant.effects import dispatch
from plant.physics import state as s
from plant.physics.equilibrium import NoEquilibriumError
from plant.physics.resting import REST, rest_records
from plant.physics.workspace import new_workspace
from plant.replay import M_SPEED
from plant.sheets.machine import Machine
from plant.unit.actuators import abilities_of
from plant.unit.equipment import Equipment

# Long steps of the integration, and the error of them added back: it is measured once per start, by a replay in fine steps, and taken
# not to depend on the parameters. A replay is five times cheaper so.
STEP_S: Final = 5e-3
FINE_S: Final = 1e-3
KEPT: Final = (
    32  # motions in the cache: more than one set of derivatives takes. Effects of sensors reuse the motion.
)

Key = tuple[object, ...]


class Loader:
    """Simulates one machine, with caches of its last motions and of the initial states of each set of segments.

    recordings: whole, for warm-up runs; without them a segment starts at rest on its tyres or rolling evenly.
    """

    def __init__(self, machine: Machine, equipment: Equipment, recordings: Sequence[Recording] = ()) -> None:
        self._variants = Variants(machine)
        self._sensors = equipment.sensors
        self._abilities = abilities_of(machine, equipment.actuators)
        self._recordings = {r.name: r for r in recordings}
        # parameters that change the motion; all others act on the sensors' readings only
        self._moving = {p.name for p in NUISANCES if not p.name.startswith(("zero.", "scale."))}
        self._moving |= {p.name for p in BODIES}
        self._moving |= {f"{name}.{fault}" for name in SPEEDS for fault in SPEED_FAULTS}
        self._moving |= self._variants.parameter_names
        self._motions: OrderedDict[Key, list[Mapping[str, Array]]] = OrderedDict()
        self._starts: OrderedDict[Key, WindowStart] = OrderedDict()
        self._long_memory_starts: OrderedDict[Key, WindowStart] = OrderedDict()
        self._wholes: dict[Key, WholeRecording | None] = {}
        self._equilibria: dict[str, dict[int, Array]] = {}
        self._lock = Lock()

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Outputs on the grid, as the sensors of the sheet would report them."""
        return self.together([window], values)[0]

    def together(self, windows: Sequence[Window], values: Mapping[str, float]) -> list[dict[str, Array]]:
        """The same for many windows."""
        wrong = {name: (1.0 + values.get(scale(name), 0.0), values.get(zero(name), 0.0)) for name in CHANNELS}
        return [
            {
                name: true if wrong[name] == (1.0, 0.0) else wrong[name][0] * true + wrong[name][1]
                for name, true in each.items()
            }
            for each in self._sensed_motions(windows, values)
        ]

    def contact_position(self, step_s: float) -> float | None:
        """Where the recorded machine drove into something [m] (`first_contact`)."""
        return first_contact(
            self._recordings.values(), self._variants.machine, self._sensors, self._abilities, step_s
        )

    def _sensed_motions(
        self, windows: Sequence[Window], values: Mapping[str, float]
    ) -> list[Mapping[str, Array]]:
        """Outputs before the zero points and scales of the sensors; the last few motions are cached."""
        which = tuple(_identity(window) for window in windows)
        key = (
            which,
            _warm_up_key(windows),
            *sorted(item for item in values.items() if item[0] in self._moving),
        )
        with self._lock:
            if key in self._motions:
                self._motions.move_to_end(key)
                return self._motions[key]
        found: list[Mapping[str, Array]] = [{}] * len(windows)
        for recording in dict.fromkeys(window.recording for window in windows):
            own = [i for i, window in enumerate(windows) if window.recording == recording]
            start = self._start_for([windows[i] for i in own], values)
            for i, outputs in zip(own, self._sensed(start, values), strict=True):
                found[i] = outputs
        with self._lock:
            self._motions[key] = found
            while len(self._motions) > KEPT:
                self._motions.popitem(last=False)
        return found

    def _sensed(self, start: WindowStart, values: Mapping[str, float]) -> list[Mapping[str, Array]]:
        """Outputs of every segment of one recording."""
        true = {
            name: values + start.step_error[name]
            for name, values in true_outputs(self._variants, start, values, STEP_S).items()
        }
        self._level(true, start)
        outputs = {
            name: self._through_sensor(name, values, start.inputs.step_s) for name, values in true.items()
        }
        rows = [slice(a, b) for a, b in pairwise(start.inputs.edges)]
        return [{name: values[own] for name, values in outputs.items()} for own in rows]

    def _level(self, true: dict[str, Array], start: WindowStart) -> None:
        """Lean levelled sensors towards what their accelerometers feel, each segment from its lean at the start; drops the felt."""
        for name, time_s, leans in zip(LEVELLED, self._levelling_s(), start.leans.T, strict=True):
            difference = true.pop(felt(name)) - true[name]
            for (a, b), first in zip(pairwise(start.inputs.edges), leans, strict=True):
                true[name][a:b] += lean(difference[a:b], first, time_s, start.inputs.step_s)

    def _levelling_s(self) -> list[float]:
        return [self._sensors.of(name).levelling for name in LEVELLED]

    def _through_sensor(self, name: str, true: Array, step_s: float) -> Array:
        """Lag and delay of the sensor's sheet; faults of sensors are effects that the engine adds.

        Segments follow one another here. The memory of the sensor reaches from one into the lead-in of the next only.
        """
        if name not in self._sensors.channels:
            return true
        sheet = self._sensors.of(name)
        kept = kept_share(sheet.lag, step_s)
        lagged = lfilter(np.array([1.0 - kept]), np.array([1.0, -kept]), true, zi=np.array([kept * true[0]]))[
            0
        ]
        return delayed(
            np.asarray(lagged, float), sheet.delay, step_s * np.arange(true.size, dtype=np.float64)
        )

    def _start_for(self, windows: Sequence[Window], values: Mapping[str, float]) -> WindowStart:
        """Start of the windows of one recording for a machine with these values.

        Effects of long memory need a warm-up run with their own values; for all other machines one start serves.
        """
        start, memory = self._common_start(windows), self._variants.long_memory(values)
        if memory == self._variants.long_memory(windows[0].warm_up):
            return start
        key = (
            _warm_up_key(windows),
            tuple(_identity(window) for window in windows),
            *sorted(memory.items()),
        )
        with self._lock:
            known = self._long_memory_starts.get(key)
        if known is None:
            # Outside the lock: these runs take the whole recording, and several may run at once.
            known = start
            with suppress(NoEquilibriumError):  # such a machine falls over: no start is better than another
                known = self._new_start({**windows[0].warm_up, **memory}, windows, start.inputs)
            with self._lock:
                self._long_memory_starts[key] = known
                while len(self._long_memory_starts) > KEPT:
                    self._long_memory_starts.popitem(last=False)
        return known

    def _common_start(self, windows: Sequence[Window]) -> WindowStart:
        """Start of the windows of one recording for the machine of the warm-up runs; the last few are cached."""
        key = (_warm_up_key(windows), *(_identity(window) for window in windows))
        with self._lock:
            if key in self._starts:
                self._starts.move_to_end(key)
            else:
                inputs = replay_inputs(windows, self._variants.machine, self._sensors, self._abilities)
                self._starts[key] = self._new_start(windows[0].warm_up, windows, inputs)
                while len(self._starts) > KEPT:
                    self._starts.popitem(last=False)
            return self._starts[key]

    def _new_start(
        self, values: Mapping[str, float], windows: Sequence[Window], inputs: ReplayInputs
    ) -> WindowStart:
        """Start after warm-up runs with a machine of these values, with the error of the integration step."""
        machine, first = self._variants.having(values), inputs.measured[inputs.edges[:-1]]
        starts, leans = self._initial_states(machine, values, windows, first, inputs)
        p, work = segment_parameters(machine, inputs, STEP_S), new_workspace()
        rests = np.empty((len(windows), REST))
        rest_records(starts, p, work, dispatch.active_vector(machine.effects), rests)
        rests[np.abs(first[:, M_SPEED]) < STANDING] = np.nan  # brakes hold a standing machine as it is
        start = WindowStart(inputs, starts, rests, leans, values)
        fine, coarse = (true_outputs(self._variants, start, values, step_s) for step_s in (FINE_S, STEP_S))
        even = np.stack([(fine[felt(name)] - fine[name])[inputs.edges[:-1]] for name in LEVELLED], axis=1)
        return replace(
            start,
            leans=np.where(np.isfinite(leans), leans, even),  # in equilibrium where no run precedes
            step_error={name: fine[name] - coarse[name] for name in fine},
        )

    def _initial_states(
        self,
        machine: Machine,
        values: Mapping[str, float],
        windows: Sequence[Window],
        first: Array,
        inputs: ReplayInputs,
    ) -> tuple[Array, Array]:
        """States (n, STATES) and leans (n, LEVELLED) at the start of each window: after a warm-up run, or in equilibrium; first: inputs there (n, MEASURED)."""
        states = np.full((len(windows), s.STATES), np.nan)
        leans = np.full((len(windows), len(LEVELLED)), np.nan)
        whole = self._whole(windows[0])
        if whole is not None:
            yaw_rate = whole.corrected_yaw_rate(values.get(zero("yaw_rate"), 0.0))
            rows = [round((float(window.time_s[0]) - whole.start_s) / inputs.step_s) for window in windows]
            if min(rows) >= 0 and max(rows) < len(whole.inputs.measured):
                with suppress(NoEquilibriumError):
                    equilibria = self._equilibria.setdefault(windows[0].recording, {})
                    states, leans = warm_up(
                        machine, values, whole.inputs, rows, equilibria, yaw_rate, self._levelling_s()
                    )
        for state, row in zip(states, first, strict=True):
            if not np.isfinite(state).all():
                state[:] = equilibrium(machine, inputs.payload, row).inside()[0]
        return states, leans

    def _whole(self, like: Window) -> WholeRecording | None:
        """The whole recording of a window, with the same channels; None where it is not known."""
        key = like.recording, *sorted(like.known)
        if key not in self._wholes:
            known = self._recordings.get(like.recording)
            self._wholes[key] = (
                None
                if known is None
                else whole_recording(known, like, self._variants.machine, self._sensors, self._abilities)
            )
        return self._wholes[key]


def _identity(window: Window) -> Key:
    return window.recording, window.start_s, window.end_s, *sorted(window.known)


def _warm_up_key(windows: Sequence[Window]) -> Key:
    """Parameters of the warm-up runs of one call, as part of a cache's key; all windows of a call share them."""
    return tuple(sorted(windows[0].warm_up.items()))
