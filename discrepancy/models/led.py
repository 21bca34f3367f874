"""The plant led through many stretches of recordings at once, with any of its parameters and effects changed.

A pilot, a machine led through what comes before a stretch, gives it the state it begins with; another machine begins
moved by as much as its rest differs (plant.resting). The pilot is that of the sheet until `settle` tells better. The stretches of
a recording are shared out among the processors, each one call of compiled code.
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from threading import Lock
from typing import Final

import numpy as np
from scipy.signal import lfilter

from discrepancy.model import Window
from discrepancy.models.begins import begun_otherwise
from discrepancy.models.leading import MISLEADING, asked_of, kept_share, measured_of, speeds_of
from discrepancy.models.loader_library import (
    CHANNELS,
    INPUTS,
    LASTING,
    NUISANCES,
    OPTIONAL,
    SPEEDS,
    fitted,
    scale,
    searched,
    zero,
)
from discrepancy.models.pilot import STANDING, at_begin, flown
from discrepancy.models.resisted import met_at
from discrepancy.models.shared_out import Way, led, parameters_of
from discrepancy.recording import Array, Recording, cleaned
from discrepancy.sensors import delayed
from discrepancy.windows import resampled
from plant import state as s
from plant.actuators import abilities_of
from plant.effects import dispatch
from plant.equilibrium import NoEquilibriumError
from plant.equipment import Equipment
from plant.follow import M_SPEED, finish
from plant.machine import Machine
from plant.resting import REST, rest_records
from plant.truth import columns_of
from plant.workspace import new_workspace

STEP_S: Final = 5e-3  # of the plant
FINE_S: Final = 1e-3  # of what tells once what that step is wrong by
BRIEF_S: Final = 2.0  # in which nothing is met
STILL_S: Final = 1.0  # standing that tells the zero point of a gyro
KEPT: Final = 32  # motions kept, for effects of sensors that only look at them again; more than one set of derivatives takes
ABSURD: Final = (
    1e3  # most that is predicted of a motion that diverged, in units of what matters of each output
)
ZEROS: Final = ((s.FRONT_FRAME, "articulation_zero"), (s.LIFT_ARM, "lift_zero"), (s.BUCKET, "tilt_zero"))
"""Joints whose measured angles are off by a nuisance."""

Key = tuple[object, ...]
Whole = tuple[float, Way, Array | None]
"""First time of a recording, what leads through it, and its yaw rate [rad/s] if that was recorded."""


@dataclass(frozen=True, slots=True)
class Basis:
    """A way through stretches of one recording, and how they begin.

    starts, rests: of the pilot (plant.resting), settled: by which sensors are off for it.
    coarse: by output, what the pilot's machine shows in steps of FINE_S beyond what it shows in steps of STEP_S.
    """

    way: Way
    starts: Array
    rests: Array
    settled: Mapping[str, float]
    coarse: Mapping[str, Array] = field(default_factory=dict)


class Loader:
    """Simulates one machine.

    Keeps the last few motions and, for each set of stretches, how they begin; recordings: whole, for the pilot. Without them each
    stretch begins at rest on its tyres or rolling evenly.
    """

    def __init__(self, machine: Machine, equipment: Equipment, recordings: Sequence[Recording] = ()) -> None:
        self._machine = machine
        self._sensors = equipment.sensors
        self._abilities = abilities_of(machine, equipment.actuators)
        self._recordings = {r.name: r for r in recordings}
        self._searched = searched()
        self._moving = {p.name for p in NUISANCES if not p.name.startswith(("zero.", "scale."))}
        self._moving |= {f"{name}.{fault}" for name in SPEEDS for fault in MISLEADING}
        self._moving |= {f"{name}.{p.name}" for name, item in self._searched.items() for p in item.parameters}
        self._kept: OrderedDict[Key, list[Mapping[str, Array]]] = OrderedDict()
        self._bases: dict[Key, Basis] = {}
        self._remembering: OrderedDict[Key, Basis] = OrderedDict()
        self._whole: dict[Key, Whole | None] = {}
        self._begun: dict[str, dict[int, Array]] = {}
        self._settled: Mapping[str, float] = {}
        self._lock = Lock()

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Outputs on the grid, as the sensors of the sheet would report them."""
        return self.together([window], values)[0]

    def together(self, windows: Sequence[Window], values: Mapping[str, float]) -> list[dict[str, Array]]:
        """The same for many windows."""
        seen = self._motions(windows, values)
        wrong = {name: (1.0 + values.get(scale(name), 0.0), values.get(zero(name), 0.0)) for name in CHANNELS}
        return [
            {
                name: true if wrong[name] == (1.0, 0.0) else wrong[name][0] * true + wrong[name][1]
                for name, true in each.items()
            }
            for each in seen
        ]

    def settle(self, values: Mapping[str, float]) -> None:
        """Let the pilot fly a machine with these values from now on: what swings at the begin of a stretch has swung for long."""
        with self._lock:
            self._settled = dict(values)
            self._kept.clear()
            self._bases.clear()
            self._remembering.clear()

    def met_at(self, step_s: float) -> float | None:
        """Where the recorded machine met something that resisted most, of the first recording in which it did (`resisted.met_at`)."""
        for recorded in self._recordings.values():
            recording, _ = cleaned(recorded)
            used = [recording.signals[name].time_s for name in INPUTS if name in recording.signals]
            if len(used) < len(INPUTS) or min(t.size for t in used) < 2:
                continue
            if min(t[-1] for t in used) - max(t[0] for t in used) < BRIEF_S:
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
            _, whole, yaw_rate = self._new_whole(recording, like)
            turning = None if yaw_rate is None else self._turning(yaw_rate, whole)
            found = met_at(self._machine, whole.payload, whole.measured, step_s, turning)
            if found is not None:
                return found
        return None

    def _motions(self, windows: Sequence[Window], values: Mapping[str, float]) -> list[Mapping[str, Array]]:
        """Outputs before the zero points of the sensors; the last few motions are kept."""
        which = tuple(_identity(window) for window in windows)
        moving = sorted(item for item in values.items() if item[0] in self._moving)
        key = (which, *moving)
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        found: list[Mapping[str, Array]] = [{}] * len(windows)
        for recording in dict.fromkeys(window.recording for window in windows):
            own = [i for i, window in enumerate(windows) if window.recording == recording]
            basis = self._remembered([windows[i] for i in own], values)
            for i, outputs in zip(own, self._simulated(basis, values), strict=True):
                found[i] = outputs
        with self._lock:
            self._kept[key] = found
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return found

    def _simulated(self, basis: Basis, values: Mapping[str, float]) -> list[Mapping[str, Array]]:
        """Outputs of every stretch of one recording."""
        seen = {
            name: self._sensed(name, true + basis.coarse[name], basis.way.step_s)
            for name, true in self._true(basis, values, STEP_S).items()
        }
        parts = [slice(a, b) for a, b in pairwise(basis.way.edges)]
        return [{name: values[part] for name, values in seen.items()} for part in parts]

    def _true(self, basis: Basis, values: Mapping[str, float], step_s: float) -> dict[str, Array]:
        """The same before any sensor, one stretch after the other, in steps of so many seconds."""
        machine = self._changed(values)
        starts, rests = basis.starts.copy(), basis.rests.copy()
        for body, name in ZEROS:  # the pilot's joints stand where its own zero points say
            starts[:, s.JOINT + body] += basis.settled.get(name, 0.0) - values.get(name, 0.0)
        if any(item.effect.start is not None for item in machine.effects):
            p, work = parameters_of(machine, basis.way, step_s), new_workspace()
            for state in starts:
                dispatch.start(machine.effects, state, p, work)
        way = begun_otherwise(values, starts, rests, basis.way, machine.tyre.radius)
        rows = led(machine, values, way, starts, rests, step_s)
        finish(rows, basis.way.payload)
        found, columns = {}, columns_of(rows)
        for name, channel in CHANNELS.items():
            quantity, index = channel.columns
            true = columns[quantity] if index is None else columns[quantity][:, index]
            most = ABSURD * channel.typical
            found[name] = np.fmin(np.fmax(true, -most), most)  # and -most what is not a number
        return found

    def _sensed(self, name: str, true: Array, step_s: float) -> Array:
        """Lag and delay of the sensor as its sheet says; its errors are what is searched for.

        Where one stretch follows another the memory of the sensor reaches into the lead-in only.
        """
        if name not in self._sensors.channels:
            return true
        sheet = self._sensors.of(name)
        kept = kept_share(sheet.lag, step_s)
        felt = lfilter(np.array([1.0 - kept]), np.array([1.0, -kept]), true, zi=np.array([kept * true[0]]))[0]
        return delayed(np.asarray(felt, float), sheet.delay, step_s * np.arange(true.size, dtype=np.float64))

    def _basis(self, windows: Sequence[Window]) -> Basis:
        """How the windows of one recording begin and what leads through them; made once."""
        key = tuple(_identity(window) for window in windows)
        with self._lock:
            if key not in self._bases:
                self._bases[key] = self._begun_by(self._settled, windows, self._way(windows))
            return self._bases[key]

    def _remembered(self, windows: Sequence[Window], values: Mapping[str, float]) -> Basis:
        """The same for a machine with effects that the pilot has not, or otherwise, if it remembers them for long: its pilot has them too."""
        basis, memory = self._basis(windows), self._memory(values)
        if memory == self._memory(self._settled):
            return basis
        key = (tuple(_identity(window) for window in windows), *sorted(memory.items()))
        with self._lock:
            known = self._remembering.get(key)
        if known is None:  # outside the lock: whole recordings are flown, one on each processor
            known = basis
            with suppress(NoEquilibriumError):  # it would fall over: no begin is better than another
                known = self._begun_by({**self._settled, **memory}, windows, basis.way)
            with self._lock:
                self._remembering[key] = known
                while len(self._remembering) > KEPT:
                    self._remembering.popitem(last=False)
        return known

    def _memory(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the effects that are remembered for long; of those that are off, their offs."""
        found: dict[str, float] = {}
        for name in LASTING:
            item = self._searched[name]
            on = any(values.get(f"{name}.{p.name}", p.off) != p.off for p in item.parameters if not p.shape)
            found |= {
                f"{name}.{p.name}": values[f"{name}.{p.name}"] if on else p.off
                for p in item.parameters
                if fitted(name, p) and (on or not p.shape)
            }
        return found

    def _begun_by(self, settled: Mapping[str, float], windows: Sequence[Window], way: Way) -> Basis:
        """Stretches as they begin behind a pilot with these values."""
        machine, first = self._changed(settled), way.measured[way.edges[:-1]]
        starts = self._starts(machine, settled, windows, first, way)
        p, active, work = (
            parameters_of(machine, way, STEP_S),
            dispatch.active_vector(machine.effects),
            new_workspace(),
        )
        rests = np.empty((len(windows), REST))
        rest_records(starts, p, work, active, rests)
        rests[np.abs(first[:, M_SPEED]) < STANDING] = np.nan  # brakes hold it as it stands
        basis = Basis(way, starts, rests, settled)
        fine, coarse = (self._true(basis, settled, step_s) for step_s in (FINE_S, STEP_S))
        return replace(basis, coarse={name: fine[name] - coarse[name] for name in fine})

    def _way(self, windows: Sequence[Window]) -> Way:
        """What leads through windows of one recording."""
        each, asked = [speeds_of(window, self._sensors) for window in windows], asked_of(windows[0])
        parts = [
            measured_of(window, speeds, self._sensors, self._machine, self._abilities, asked=asked)
            for window, speeds in zip(windows, each, strict=True)
        ]
        edges = np.cumsum([0, *(len(part) for part in parts)]).astype(np.intp)
        speeds = {name: np.concatenate([own[name] for own in each]) for name in each[0]}
        payload = windows[0].constants.get("payload", 0.0)
        return Way(np.concatenate(parts), speeds, edges, asked, payload, windows[0].step_s)

    def _starts(
        self,
        machine: Machine,
        settled: Mapping[str, float],
        windows: Sequence[Window],
        first: Array,
        way: Way,
    ) -> Array:
        """States at the begin of each window (n, STATES): the pilot's, or at rest on the tyres, or rolling evenly; first: what was measured there."""
        states = np.full((len(windows), s.STATES), np.nan)
        known = self._recorded(windows[0])
        if known is not None:
            begin, whole, yaw_rate = known
            turning = None if yaw_rate is None else self._turning(yaw_rate, whole)
            rows = [round((float(window.time_s[0]) - begin) / way.step_s) for window in windows]
            if min(rows) >= 0 and max(rows) < len(whole.measured):
                with suppress(NoEquilibriumError):
                    begun = self._begun.setdefault(windows[0].recording, {})
                    states = flown(machine, settled, whole, rows, begun, turning)
        for state, row in zip(states, first, strict=True):
            if not np.isfinite(state).all():
                state[:] = at_begin(machine, way.payload, row).inside()[0]
        return states

    def _turning(self, yaw_rate: Array, whole: Way) -> Array:
        """The measured yaw rate without the zero point that it shows at a standstill, or else the fitted one if it may be that."""
        still = np.abs(whole.measured[:, M_SPEED]) < STANDING
        if np.count_nonzero(still) * whole.step_s > STILL_S:
            return yaw_rate - float(np.median(yaw_rate[still]))
        likely = CHANNELS["yaw_rate"].zero
        return yaw_rate - min(max(self._settled.get(zero("yaw_rate"), 0.0), -likely), likely)

    def _recorded(self, like: Window) -> Whole | None:
        """The whole of a recording, with the same signals as a window of it; None where it is not known."""
        key = like.recording, *sorted(like.known)
        if key not in self._whole:
            known = self._recordings.get(like.recording)
            self._whole[key] = None if known is None else self._new_whole(known, like)
        return self._whole[key]

    def _new_whole(self, recording: Recording, like: Window) -> Whole:
        used = [recording.signals[name] for name in INPUTS]
        begin, end = max(x.time_s[0] for x in used), min(x.time_s[-1] for x in used)
        grid = begin + like.step_s * np.arange(int((end - begin) / like.step_s) + 1, dtype=np.float64)
        names = [n for n in (*INPUTS, *OPTIONAL, *SPEEDS) if like.has(n) and n in recording.signals]
        known = {n: resampled(recording.signals[n], grid) for n in names}
        whole = replace(like, start_s=float(begin), end_s=float(end), time_s=grid, known=known)
        yaw_rate = recording.signals.get("yaw_rate")
        return float(begin), self._way([whole]), None if yaw_rate is None else resampled(yaw_rate, grid)

    def _changed(self, values: Mapping[str, float]) -> Machine:
        """The sheet's machine with the nuisances' values, and the effects that are not at their off."""
        m = self._machine
        stiffer = 1.0 + values.get("tyre_stiffness", 0.0)
        tyre = replace(
            m.tyre,
            qfz1=m.tyre.qfz1 * stiffer,
            qfz2=m.tyre.qfz2 * stiffer,
            radius=m.tyre.radius + values.get("wheel_radius", 0.0),
        )
        rear = replace(
            m.rear_frame,
            mass=m.rear_frame.mass + values.get("rear_mass", 0.0),
            z=m.rear_frame.z + values.get("rear_height", 0.0),
        )
        front = replace(m.front_frame, mass=m.front_frame.mass + values.get("front_mass", 0.0))
        chosen = [
            item.of(**{p.name: values[f"{name}.{p.name}"] for p in item.parameters if fitted(name, p)})
            for name, item in self._searched.items()
            if any(values.get(f"{name}.{p.name}", p.off) != p.off for p in item.parameters if not p.shape)
        ]
        return replace(m, tyre=tyre, rear_frame=rear, front_frame=front, effects=(*m.effects, *chosen))


def _identity(window: Window) -> Key:
    return window.recording, window.start_s, window.end_s, *sorted(window.known)
