"""The plant led through many stretches of recordings at once, with any of its parameters and effects changed.

A pilot, a machine led through the whole recording, gives every stretch the state it begins with; another machine begins
moved by as much as its rest differs (plant.resting). The pilot is that of the sheet until `settle` tells better. The stretches of
a recording are shared out among the processors, each one call of compiled code.
"""

import os
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from discrepancy.model import Window
from discrepancy.models.leading import MISLEADING, asked_of, kept_share, measured_of, shifted, speeds_of
from discrepancy.models.loader_library import (
    CHANNELS,
    INPUTS,
    NUISANCES,
    OPTIONAL,
    SPEEDS,
    fitted,
    searched,
    zero,
)
from discrepancy.recording import Array, Recording
from discrepancy.sensors import delayed
from discrepancy.windows import resampled
from plant import state as s
from plant.actuators import abilities_of
from plant.effects import dispatch
from plant.equilibrium import NoEquilibriumError
from plant.equipment import Equipment
from plant.follow import (
    M_ARTICULATION,
    M_LIFT,
    M_SPEED,
    M_TILT,
    Asked,
    finish,
    follow,
    lead,
    led_parameters,
)
from plant.machine import Machine
from plant.parameters import parameter_vector
from plant.plant import Plant
from plant.resting import REST, rest_records
from plant.surface import Surface
from plant.truth import Observer, Truth, columns_of
from plant.workspace import new_workspace

STEP_S: Final = 5e-3  # of the plant
FINE_S: Final = 1e-3  # of what tells once what that step is wrong by
PILOT_S: Final = 2.5e-3  # of the pilot, who flies the whole recording
KEPT: Final = 8  # motions kept, for effects of sensors that only look at them again
CORES: Final = os.cpu_count() or 1
STANDING: Final = 0.02  # wheel speed [rad/s] below which a stretch begins at a standstill
ABSURD: Final = (
    1e3  # most that is predicted of a motion that diverged, in units of what matters of each output
)
ZEROS: Final = ((s.FRONT_FRAME, "articulation_zero"), (s.LIFT_ARM, "lift_zero"), (s.BUCKET, "tilt_zero"))
"""Joints whose measured angles are off by a nuisance."""

Key = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class Basis:
    """Stretches of one recording, one after the other, as they were measured.

    speeds: of the wheels; edges: rows where stretches begin, and their end; starts, rests: of the pilot (plant.resting); asked: which joints' rates are those asked for.
    coarse: by output, what the pilot's machine shows in steps of FINE_S beyond what it shows in steps of STEP_S.
    """

    measured: Array
    speeds: Array
    edges: NDArray[np.intp]
    starts: Array
    rests: Array
    asked: Asked
    payload: float
    step_s: float
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
        self._moving = {p.name for p in NUISANCES if not p.name.startswith("zero.")}
        self._moving |= {f"{name}.{fault}" for name in SPEEDS for fault in MISLEADING}
        self._moving |= {f"{name}.{p.name}" for name, item in self._searched.items() for p in item.parameters}
        self._kept: OrderedDict[Key, list[Mapping[str, Array]]] = OrderedDict()
        self._bases: dict[Key, Basis] = {}
        self._pilots: dict[str, tuple[float, Array] | None] = {}
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
        return [{name: true + values.get(zero(name), 0.0) for name, true in each.items()} for each in seen]

    def settle(self, values: Mapping[str, float]) -> None:
        """Let the pilot fly a machine with these values from now on: what swings at the begin of a stretch has swung for long."""
        with self._lock:
            self._settled = dict(values)
            for kept in (self._kept, self._bases, self._pilots):
                kept.clear()

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
            basis = self._basis([windows[i] for i in own])
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
            name: self._sensed(name, true + basis.coarse[name], basis.step_s)
            for name, true in self._true(basis, values, STEP_S).items()
        }
        parts = [slice(a, b) for a, b in zip(basis.edges[:-1], basis.edges[1:], strict=True)]
        return [{name: values[part] for name, values in seen.items()} for part in parts]

    def _true(self, basis: Basis, values: Mapping[str, float], step_s: float) -> dict[str, Array]:
        """The same before any sensor, one stretch after the other, in steps of so many seconds."""
        machine = self._changed(values)
        p = led_parameters(parameter_vector(machine, Surface(), basis.payload), step_s, asked=basis.asked)
        active = dispatch.active_vector(machine.effects)
        starts = basis.starts.copy()
        for body, name in ZEROS:  # the pilot's joints stand where its own zero points say
            starts[:, s.JOINT + body] += self._settled.get(name, 0.0) - values.get(name, 0.0)
        if any(item.effect.start is not None for item in machine.effects):
            work = new_workspace()
            for state in starts:
                dispatch.start(machine.effects, state, p, work)
        rows = np.full((len(basis.measured), Truth.size), np.nan)
        measured, measures = (
            shifted(basis.measured, basis.speeds, basis.edges, values, basis.step_s),
            Observer(machine, basis.payload).measures,
        )

        def lead_part(first: int, last: int) -> None:
            try:
                lead_all(first, last)
            except (
                np.linalg.LinAlgError
            ):  # a motion has diverged beyond what can be solved; its rows stay as they are
                for stretch in range(first, last) if last - first > 1 else ():
                    lead_part(stretch, stretch + 1)

        def lead_all(first: int, last: int) -> None:
            edges = basis.edges[first : last + 1]
            own = slice(edges[0], edges[-1])
            lead(
                starts[first:last],
                basis.rests[first:last],
                measured[own],
                edges - edges[0],
                p,
                basis.asked,
                step_s,
                round(basis.step_s / step_s),
                new_workspace(),
                active,
                measures,
                rows[own],
                np.zeros((0, s.STATES)),
            )

        with ThreadPoolExecutor(CORES) as pool:
            list(pool.map(lead_part, *_shares(basis.edges, CORES)))
        finish(rows, basis.payload)
        found, columns = {}, columns_of(rows)
        for name, channel in CHANNELS.items():
            quantity, index = channel.columns
            true = columns[quantity] if index is None else columns[quantity][:, index]
            most = ABSURD * channel.typical
            found[name] = np.clip(np.where(np.isfinite(true), true, most), -most, most)
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
                self._bases[key] = self._new_basis(windows)
            return self._bases[key]

    def _new_basis(self, windows: Sequence[Window]) -> Basis:
        payload, step, asked = (
            windows[0].constants.get("payload", 0.0),
            windows[0].step_s,
            asked_of(windows[0]),
        )
        parts = [self._measured(window, asked) for window in windows]
        machine = self._changed(self._settled)
        sizes = [len(part) for part in parts]
        p = led_parameters(parameter_vector(machine, Surface(), payload), STEP_S, asked=asked)
        active, work = dispatch.active_vector(machine.effects), new_workspace()
        starts = np.stack([self._start(w, part[0], asked) for w, part in zip(windows, parts, strict=True)])
        rests = np.empty((len(windows), REST))
        rest_records(starts, p, work, active, rests)
        standing = [abs(part[0, M_SPEED]) < STANDING for part in parts]
        rests[standing] = np.nan  # brakes hold it as it stands
        edges = np.concatenate(([0], np.cumsum(sizes))).astype(np.intp)
        speeds = np.concatenate([speeds_of(window, self._sensors) for window in windows])
        basis = Basis(np.concatenate(parts), speeds, edges, starts, rests, asked, payload, step)
        fine, coarse = (self._true(basis, self._settled, step_s) for step_s in (FINE_S, STEP_S))
        return replace(basis, coarse={name: fine[name] - coarse[name] for name in fine})

    def _start(self, window: Window, first: Array, asked: Asked) -> Array:
        """State at the begin of a window: the pilot's, or at rest on the tyres, or rolling evenly."""
        pilot = self._pilot(window, asked)
        if pilot is not None:
            begin, states = pilot
            row = round((float(window.time_s[0]) - begin) / window.step_s)
            if 0 <= row < len(states) and np.isfinite(states[row]).all():
                return np.asarray(states[row], float)
        machine = self._changed(self._settled)
        return _plant(machine, window.constants.get("payload", 0.0), first).inside()[0]

    def _pilot(self, window: Window, asked: Asked) -> tuple[float, Array] | None:
        """First time and the states of the machine led through the whole recording; None where it is not known."""
        name = window.recording
        if name not in self._pilots:
            self._pilots[name] = (
                self._flown(self._recordings[name], window, asked) if name in self._recordings else None
            )
        return self._pilots[name]

    def _flown(self, recording: Recording, like: Window, asked: Asked) -> tuple[float, Array] | None:
        used = [recording.signals[name] for name in INPUTS]
        begin, end = max(x.time_s[0] for x in used), min(x.time_s[-1] for x in used)
        grid = begin + like.step_s * np.arange(int((end - begin) / like.step_s) + 1, dtype=np.float64)
        names = [n for n in (*INPUTS, *OPTIONAL, *SPEEDS) if like.has(n) and n in recording.signals]
        whole = replace(
            like,
            start_s=float(begin),
            end_s=float(end),
            time_s=grid,
            known={n: resampled(recording.signals[n], grid) for n in names},
        )
        speeds, ends = speeds_of(whole, self._sensors), np.array([0, grid.size])
        measured = shifted(self._measured(whole, asked), speeds, ends, self._settled, like.step_s)
        try:
            plant = _plant(self._changed(self._settled), like.constants.get("payload", 0.0), measured[0])
        except NoEquilibriumError:
            return None
        _, states = follow(plant, measured, interval_s=like.step_s, step_s=PILOT_S, asked=asked)
        return float(begin), states

    def _measured(self, window: Window, asked: Asked) -> Array:
        return measured_of(window, self._sensors, self._machine, self._abilities, asked=asked)

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


def _plant(machine: Machine, payload: float, first: Array) -> Plant:
    """A plant as the first row of what was measured begins."""
    speed = float(first[M_SPEED]) * machine.tyre.radius * 0.98
    return Plant(
        machine,
        payload_mass=payload,
        speed=speed if abs(first[M_SPEED]) > STANDING else 0.0,
        articulation_angle=_within(first[M_ARTICULATION], -machine.steering.limit, machine.steering.limit),
        lift_arm_angle=_within(first[M_LIFT], machine.lift.lower_limit, machine.lift.upper_limit),
        tilt_angle=_within(first[M_TILT], machine.tilt.lower_limit, machine.tilt.upper_limit),
    )


def _shares(edges: NDArray[np.intp], count: int) -> tuple[list[int], list[int]]:
    """Where `count` runs of whole stretches of about equal length begin and end; fewer where there are fewer stretches."""
    wanted = np.linspace(edges[0], edges[-1], count + 1)
    cuts = np.unique([int(np.argmin(np.abs(edges - row))) for row in wanted]).tolist()
    return cuts[:-1], cuts[1:]


def _within(value: float, low: float, high: float) -> float:
    return float(min(max(value, low), high))
