"""The wheel loader itself, with its whole effect library, led by what was measured.

Inputs are the measured wheel torques and joint angles; the plant's own equations give everything else: wheel speeds,
inertial readings, cylinder pressures, and the wheel forces where test instruments recorded them. A gain draws the speed to
the measured one, so that an error of force shows as a steady difference (plant.follow). What the machine's sheet
does not know exactly (masses, height of the centre of gravity, tyre stiffness, zero points of the sensors) gives way first.
"""

import json
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from bus.mistake import Mistake
from dbc import loader_database, reference_database
from dbc.columns import ColumnDecoder, Columns
from dbc.packing import Signals
from dbc.recording import read_frames
from dbc.units import factor_to
from discrepancy.model import Effect, Model, Parameter, Window
from discrepancy.recording import Array, Recording, Signal, signal
from discrepancy.sensors import delayed, lagged, sensor_effects
from plant.effects import effects as plant_effects
from plant.effects.effect import Effect as PlantEffect
from plant.effects.effect import Parameter as PlantParameter
from plant.equilibrium import NoEquilibriumError
from plant.equipment import load_equipment
from plant.follow import (
    M_ARTICULATION,
    M_BRAKING,
    M_LIFT,
    M_SPEED,
    M_TILT,
    M_TORQUE,
    MEASURED,
    Led,
    follow,
)
from plant.interface import MACHINE_MESSAGES, REFERENCE_MESSAGES
from plant.machine import Machine, load_machine
from plant.plant import DivergedError, Plant
from plant.sensors import WHEELS, SensorParameters
from plant.truth import columns_of

STEP_S: Final = 0.01
FINE_S: Final = 2e-3  # step of the plant
SMOOTHED: Final = (
    21  # grid points of the centred quadratic that smooths articulation and speed: 0.2 s, no phase
)
LEVELLED: Final = (
    51  # the same of the linkage, which moves slowly: noise of its angle would shake the pressures
)
KEPT: Final = 8  # motions kept, for effects of sensors that only look at them again
STANDING: Final = 0.02  # wheel speed [rad/s] below which a recording begins at a standstill
ABSURD: Final = 1e3  # what a motion that diverged predicts, in units of each output's typical size

HEAVIEST_KG: Final = 20_000.0  # payload, as in a scenario

UNSEARCHED: Final = frozenset(
    {
        "motor_lag",  # the torque is an input, with its lag
        "steering_play",  # as is the articulation
        "steering_compliance",
        "kerb",  # somewhere on the way: the open-ended part tells where
        "ditch",
        "enveloped_step",
        "wheel_rigid_ring",  # its modes are above what 100 Hz and the bus's filters show
    }
)
"""Effects of the plant that cannot be seen in, or not searched for by, this form of the model."""

FITTED_SHAPES: Final = frozenset(
    {
        "payload_slosh.frequency_hz",
        "payload_slosh.damping",
        "rolling_resistance.growth_per_m_per_s",
        "washboard.wavelength_m",
        "pile_entry.distance_m",
        "pile_entry.depth_m",
        "pile_entry.weight_share",
        "soil_sinkage.exponent",
        "brake_fade.capacity_J_per_K",
    }
)
"""Parameters that say how an effect acts and that a recording can tell; others stay typical."""

TORQUES = tuple(f"wheel_torque_{wheel}" for wheel in WHEELS)
SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
INPUTS: Mapping[str, str] = {
    **dict.fromkeys(TORQUES, "N.m"),
    "articulation_angle": "rad",
    "articulation_rate": "rad/s",
    "lift_arm_angle": "rad",
    "tilt_angle": "rad",
}
OPTIONAL: Mapping[str, str] = {"brake_demand": "1"}


@dataclass(frozen=True, slots=True)
class Channel:
    """An output: its unit, an error that matters, what its zero point may be off by, and what its sensor does."""

    unit: str
    typical: float
    zero: float
    columns: tuple[str, int | None]
    faults: tuple[str, ...] = ()


def _machine_channels() -> dict[str, Channel]:
    faults = ("bias", "scale", "delay", "lag")
    return {
        **{
            name: Channel("rad/s", 0.05, 0.0, ("wheel_speed", i), ("scale", "delay"))
            for i, name in enumerate(SPEEDS)
        },
        **{
            f"acceleration_{axis}": Channel("m/s^2", 0.1, 0.1, ("imu_specific_force", i), faults)
            for i, axis in enumerate("xyz")
        },
        **{
            f"{axis}_rate": Channel("rad/s", 0.01, 0.006, ("angular_velocity", i), faults)
            for i, axis in enumerate(("roll", "pitch", "yaw"))
        },
        "pitch_angle": Channel("rad", 0.005, 0.005, ("pitch", None), ("bias", "delay", "lag")),
        "roll_angle": Channel("rad", 0.005, 0.005, ("roll", None), ("bias", "delay", "lag")),
        "lift_pressure": Channel("Pa", 2e5, 1e5, ("lift_pressure", None), ("bias", "scale", "delay", "lag")),
        "tilt_pressure": Channel("Pa", 2e5, 1e5, ("tilt_pressure", None), ("bias", "scale")),
    }


def _reference_channels() -> dict[str, Channel]:
    wheels = {
        f"{quantity}_{wheel}": Channel("N", 500.0, 0.0, (quantity, i))
        for quantity in ("normal_force", "longitudinal_force", "lateral_force")
        for i, wheel in enumerate(WHEELS)
    }
    return {
        **wheels,
        "joint_torque": Channel("N.m", 500.0, 0.0, ("joint_torque", None)),
        "oscillation_angle": Channel("rad", 0.005, 0.0, ("oscillation_angle", None)),
    }


CHANNELS: Mapping[str, Channel] = {**_machine_channels(), **_reference_channels()}


def _zero(name: str) -> str:
    return f"zero.{name}"


NUISANCES = (
    Parameter(name="rear_mass", unit="kg", lower=-1500.0, upper=1500.0, typical=100.0, prior_sd=120.0),
    Parameter(name="front_mass", unit="kg", lower=-800.0, upper=800.0, typical=50.0, prior_sd=60.0),
    Parameter(name="rear_height", unit="m", lower=-0.4, upper=0.4, typical=0.03, prior_sd=0.05),
    Parameter(name="tyre_stiffness", unit="1", lower=-0.5, upper=1.0, typical=0.05, prior_sd=0.05),
    Parameter(name="torque_scale", unit="1", lower=-0.2, upper=0.2, typical=0.02, prior_sd=0.02),
    Parameter(name="articulation_zero", unit="rad", lower=-0.05, upper=0.05, typical=0.003, prior_sd=0.004),
    Parameter(name="wheel_radius", unit="m", lower=-0.03, upper=0.03, typical=0.002, prior_sd=0.002),
    *(
        Parameter(name=_zero(name), unit=channel.unit, typical=channel.zero, prior_sd=channel.zero)
        for name, channel in CHANNELS.items()
        if channel.zero > 0.0
    ),
)


def _engine_parameter(effect: str, p: PlantParameter) -> Parameter:
    """In its own unit; a shape begins at its typical value."""
    change = 0.2 * (p.typical or p.high) if p.shape else p.typical - p.off or 0.1 * (p.high - p.low)
    return Parameter(
        name=f"{effect}.{p.name}",
        unit=p.unit,
        value=p.typical - change if p.shape else p.off,
        lower=p.low,
        upper=p.high,
        typical=change,
        shape=p.shape,
    )


def _fitted(effect: str, p: PlantParameter) -> bool:
    return not p.shape or f"{effect}.{p.name}" in FITTED_SHAPES


def _engine_effect(item: PlantEffect) -> Effect:
    """An effect of the plant in the words of the engine."""
    return Effect(
        name=item.name,
        sentence=item.sentence.rstrip("."),
        equation=item.equation,
        parameters=tuple(_engine_parameter(item.name, p) for p in item.parameters if _fitted(item.name, p)),
        kind="physics",
        place=item.acts_on,
        excited_by=item.excited_by,
        confusable={c.name: c.separate for c in item.confusable},
    )


def _searched() -> dict[str, PlantEffect]:
    """Effects of the plant that this model searches: those of physics that vanish somewhere."""
    return {
        name: item
        for name, item in plant_effects().items()
        if item.sensors is None and name not in UNSEARCHED and not all(p.shape for p in item.parameters)
    }


def library() -> tuple[Effect, ...]:
    """The plant's physics, and the faults of every sensor."""
    physics = [_engine_effect(item) for item in _searched().values()]
    faults = [
        fault
        for name, channel in CHANNELS.items()
        if channel.faults
        for fault in sensor_effects(name, channel.unit, bias=2.0 * channel.typical, kinds=channel.faults)
    ]
    return (*physics, *faults)


class Loader:
    """Simulates one machine; keeps nothing but the machine's sheet."""

    def __init__(self, machine: Machine, sensors: SensorParameters) -> None:
        self._machine = machine
        self._sensors = sensors
        self._searched = _searched()
        self._moving = {p.name for p in NUISANCES if not p.name.startswith("zero.")}
        self._moving |= {f"{name}.{p.name}" for name, item in self._searched.items() for p in item.parameters}
        self._kept: OrderedDict[tuple[object, ...], Mapping[str, Array]] = OrderedDict()

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Outputs on the grid, as the sensors of the sheet would report them."""
        seen = self._motion(window, values)
        return {name: true + values.get(_zero(name), 0.0) for name, true in seen.items()}

    def _motion(self, window: Window, values: Mapping[str, float]) -> Mapping[str, Array]:
        """Outputs before the zero points of the sensors; the last few motions are kept."""
        moving = (item for item in values.items() if item[0] in self._moving)
        key = (window.recording, window.start_s, window.end_s, *sorted(moving))
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        self._kept[key] = found = self._simulated(window, values)
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return found

    def _simulated(self, window: Window, values: Mapping[str, float]) -> Mapping[str, Array]:
        measured = measured_of(window, values, self._sensors)
        try:
            led = self._led(self._changed(values), measured, window)
        except (DivergedError, NoEquilibriumError):
            return {name: np.full(len(measured), ABSURD * c.typical) for name, c in CHANNELS.items()}
        columns = columns_of(led.rows)
        outputs = {}
        for name, channel in CHANNELS.items():
            field, index = channel.columns
            true = columns[field] if index is None else columns[field][:, index]
            true = np.where(np.isfinite(true), true, ABSURD * channel.typical)
            outputs[name] = self._sensed(name, true, window)
        return outputs

    def _led(self, machine: Machine, measured: Array, window: Window) -> Led:
        first = measured[0]
        speed = float(first[M_SPEED]) * machine.tyre.radius * 0.98
        plant = Plant(
            machine,
            payload_mass=window.constants.get("payload", 0.0),
            speed=speed if abs(first[M_SPEED]) > STANDING else 0.0,
            articulation_angle=_within(first[M_ARTICULATION], machine.steering.limit),
            lift_arm_angle=min(max(float(first[M_LIFT]), machine.lift.lower_limit), machine.lift.upper_limit),
            tilt_angle=min(max(float(first[M_TILT]), machine.tilt.lower_limit), machine.tilt.upper_limit),
        )
        return follow(plant, measured, interval_s=window.step_s, step_s=FINE_S)

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
            item.of(**{p.name: values[f"{name}.{p.name}"] for p in item.parameters if _fitted(name, p)})
            for name, item in self._searched.items()
            if any(values.get(f"{name}.{p.name}", p.off) != p.off for p in item.parameters if not p.shape)
        ]
        return replace(m, tyre=tyre, rear_frame=rear, front_frame=front, effects=(*m.effects, *chosen))

    def _sensed(self, name: str, true: Array, window: Window) -> Array:
        """Lag and delay of the sensor as its sheet says; its errors are what is searched for."""
        if name not in self._sensors.channels:
            return true
        sheet = self._sensors.of(name)
        return delayed(lagged(true, sheet.lag, window.step_s), sheet.delay, window.time_s)


def _within(value: float, limit: float) -> float:
    return float(min(max(value, -limit), limit))


def measured_of(window: Window, values: Mapping[str, float], sensors: SensorParameters) -> Array:
    """What leads the plant, (n, MEASURED): the recorded inputs without what their sensors did to them.

    Lags and delays of the sheet are undone by reading as much later; for the slow motions of the inputs a lag is a delay.
    """

    def read(name: str) -> Array:
        sheet = sensors.of(name)
        return delayed(window[name], -(sheet.lag + sheet.delay), window.time_s)

    measured = np.zeros((window.time_s.size, MEASURED))
    for i, name in enumerate(TORQUES):
        measured[:, M_TORQUE + i] = read(name) / (1.0 + values.get("torque_scale", 0.0))
    if window.has("brake_demand"):
        measured[:, M_BRAKING] = window["brake_demand"] > 0.0
    known = [read(name) for name in SPEEDS if window.has(name)]
    measured[:, M_SPEED] = _smooth(np.mean(known, axis=0)) if known else 0.0
    zero = values.get("articulation_zero", 0.0)
    measured[:, M_ARTICULATION] = _smooth(read("articulation_angle")) - zero
    measured[:, M_ARTICULATION + 1] = _smooth(read("articulation_rate"))
    for at, name in ((M_LIFT, "lift_arm_angle"), (M_TILT, "tilt_angle")):
        angle = read(name)
        measured[:, at] = _smooth(angle, LEVELLED)
        measured[:, at + 1] = _smooth(angle, LEVELLED, rate_of=window.step_s)
    return measured


def _smooth(values: Array, points: int = SMOOTHED, *, rate_of: float | None = None) -> Array:
    """Centred quadratic over `points`; its slope per second where rate_of gives the step [s]."""
    odd = min(points, values.size // 2 * 2 - 1)
    order, delta = (0, 1.0) if rate_of is None else (1, rate_of)
    return np.asarray(savgol_filter(values, odd, 2, deriv=order, delta=delta, mode="nearest"), np.float64)


@lru_cache(maxsize=4)
def _loader(machine: str) -> Loader:
    return Loader(load_machine(machine), load_equipment("l60").sensors)


def model(_: Sequence[Recording] = (), *, machine: str = "l60", without: tuple[str, ...] = ()) -> Model:
    """The loader; machine: name or TOML file; without: effects that are not searched."""
    return Model(
        name="loader",
        sentence="an articulated wheel loader, led by its measured torques and joint angles",
        inputs=INPUTS,
        optional=OPTIONAL,
        outputs={name: channel.unit for name, channel in CHANNELS.items()},
        nuisances=NUISANCES,
        effects=tuple(e for e in library() if e.name not in without),
        simulate=_loader(machine),
        step_s=STEP_S,
        window_s=None,
        held_out_s=1.0,
    )


def load_run(folder: Path) -> Recording:
    """A recorded run: bus.log, and reference.log where instruments recorded; stamps are those of the samples.

    The payload is that of run.json, 0 where there is none; raises DamagedRecord where that file cannot be used.
    """
    files = [(folder / "bus.log", loader_database(), MACHINE_MESSAGES)]
    if (folder / "reference.log").is_file():
        files.append((folder / "reference.log", reference_database(), REFERENCE_MESSAGES))
    signals: dict[str, Signal] = {}
    for path, database, messages in files:
        columns = ColumnDecoder(database).decode(read_frames(path))
        first = min(float(c.time_s[0]) for name, c in columns.items() if name in messages)
        for name in messages.keys() & columns.keys():
            signals |= {
                k: s for k, s in _signals(columns[name], messages[name], first).items() if k not in signals
            }
    return Recording(folder.name, signals, _constants(folder / "run.json"))


class DamagedRecord(Mistake, ValueError):
    """The record of a run cannot be used; the message names the file, the key and the cause."""


def _constants(record: Path) -> dict[str, float]:
    """What the record of the run tells of the day: the payload [kg]. Raises DamagedRecord; without a record nothing is known."""
    if not record.is_file():
        return {}
    try:
        payload = json.loads(record.read_text(encoding="utf-8"))["payload_kg"]
    except (OSError, ValueError) as error:
        raise DamagedRecord(f"{record}: cannot be read as the record of a run: {error}") from error
    except (KeyError, TypeError) as error:
        raise DamagedRecord(f"{record}: has no payload_kg; is it the record of a run?") from error
    if isinstance(payload, bool) or not isinstance(payload, int | float) or not 0.0 <= payload <= HEAVIEST_KG:
        raise DamagedRecord(f"{record}: payload_kg={payload!r} is not a mass from 0 to {HEAVIEST_KG:g} kg")
    return {"payload": float(payload)}


def _signals(found: Columns, wanted: Signals, first: float) -> dict[str, Signal]:
    """What the model uses of one message, SI; frames leave within the tick of their sample."""
    time_s = np.floor((found.time_s - first) / STEP_S + 0.01) * STEP_S
    signals = {}
    for label, (unit, source) in wanted.items():
        name = source.replace(" ", "_")
        if name in CHANNELS or name in INPUTS or name in OPTIONAL:
            values = np.asarray(found.signals[label], float) * factor_to(
                unit, found.codec.by_signal[label].unit
            )
            signals[name] = signal(time_s, values, unit.replace("s2", "s^2"))
    return signals
