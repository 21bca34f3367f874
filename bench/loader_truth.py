"""Bodies of truth for the loader's diagnosis: random drives on the bench with hidden effects.

    record(Arm("payload_mass", seed=3, scale=1.0), Path("out/run"))   writes a run directory and returns what is true
    loader.load_run(Path("out/run"))                                   reads it as the diagnosis does

Everything passes what a real drive passes: the driver, the limits of the ECU, sensors with noise, bias, lag and resolution, and the
CAN encoding. The motion is the plant's with another integrator and step than the measurement-driven replay of the diagnosis has (`truth="rk4"`), or
MuJoCo's (`truth="mujoco"`: bodies and integration are MuJoCo's, tyre and servo laws ours). Masses, height, tyres and the
zero points of sensors differ from the sheet by what the model's priors say.

Seeds below 1000 are for tuning; what is reported uses seeds from 1000 on.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from bench.loader_mujoco import MujocoMotion
from discrepancy.model.description import Model
from discrepancy.models.loader import model as loader
from hil import rundir
from hil.compose import Choice
from hil.ecu_side import ecu_cycle
from hil.lockstep import Lockstep
from hil.runs import write_recording
from plant.effects import effects as plant_effects
from plant.physics.surface import Surface
from plant.plant import Plant
from plant.sheets.machine import Machine, load_machine
from plant.unit.equipment import Equipment, load_equipment
from plant.unit.profile import Profile
from plant.unit.scenario import Scenario, Start
from plant.unit.script import Script
from plant.unit.sensor_parameters import ChannelParameters
from plant.unit.unit import Motion, PlantUnit

Body = Literal["plant", "rk4", "mujoco"]

STEP_S = 1e-3
REPORTED = 1000  # seeds from here on are for reports only
SPEEDS_M_S = (-2.0, 0.0, 1.0, 2.0, 3.0, 4.5)
TURNS_RAD = (0.0, 0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6)
PAYLOADS_KG = (0.0, 1500.0, 3000.0)
SPREAD: Mapping[str, float] = {
    "rear_mass": 60.0,
    "front_mass": 30.0,
    "rear_height": 0.025,
    "tyre_stiffness": 0.03,
    "wheel_radius": 0.001,
}
"""Standard deviation of the machine's deviations from its sheet, within the priors of the model's nuisances."""
LATER_SPREAD: Mapping[str, float] = {
    "slip_stiffness": 0.05,
    "cornering_stiffness": 0.05,
    "rear_x": 0.025,
    "front_x": 0.025,
}
"""The same of the tyres' slopes at no slip and of the frames' centres along them, which reports before November 2026 did not vary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One recording to be made and diagnosed."""

    effects: tuple[str, ...] = ()  # names in the model's library, physics or sensor; () for a null
    seed: int = 0
    scale: float = 1.0  # size of each effect in its typical change
    # sizes by parameter name ('rolling_resistance.coefficient'), in its unit; they override `scale`
    values: Mapping[str, float] | None = None
    # effects of the plant beside them, of which the model is to know nothing; every parameter by name, in its unit
    beside: Mapping[str, float] | None = None
    truth: Body = "rk4"
    duration_s: float = 40.0

    @property
    def name(self) -> str:
        """Fit for a folder."""
        label = "+".join(self.effects).replace(" ", "-") or "null"
        return f"{label}_{self.scale:g}_{self.truth}_{self.seed}"


REPORT_EFFECTS = (
    "rolling_resistance",
    "payload_mass",
    "grade",
    "brake_drag",
    "lateral_relaxation",
    "tyre_wear",
    "inflation_pressure",
    "aerodynamic_drag",
    "mass_split",
    "pile_entry",
    "soil_sinkage",
    "oscillation_stops",
    "surface_friction",
    "vertical_damping",
    "wheel_spin_inertia",
    "yaw_rate lag",
    "yaw_rate delay",
    "yaw_rate scale",
    "specific_force_x scale",
    "specific_force_y bias",
    "pitch_angle delay",
    "lift_pressure scale",
    "tilt_pressure bias",
    "wheel_speed_front_left scale",
)
"""Quite different ones, from tyre to sensor."""

MUJOCO_EFFECTS = (
    "payload_mass",
    "grade",
    "brake_drag",
    "inflation_pressure",
    "surface_friction",
    "yaw_rate lag",
    "specific_force_x scale",
    "lift_pressure scale",
    "wheel_speed_front_left scale",
)
"""Those that reach MuJoCo's bodies: by the parameters of tyre, mass and ground, by wheel torques, or through a sensor."""


def arms(
    *, seeds: int = 1, nulls: int = 6, scales: Sequence[float] = (1.0,), first_seed: int = REPORTED
) -> Iterator[Arm]:
    """What a report is made of: nulls, every effect at each scale, pairs, and MuJoCo's drives."""
    for seed in range(first_seed, first_seed + seeds):
        for repeat in range(nulls):
            yield Arm(seed=seed + 100 * repeat)
            # a third of the nulls: MuJoCo's drives take longer
            if repeat % 3 == 0:
                yield Arm(seed=seed + 100 * repeat, truth="mujoco")
        for number, effect in enumerate(REPORT_EFFECTS):
            for scale in scales:
                yield Arm(effects=(effect,), seed=seed + 10 * number, scale=scale)
        for number, effect in enumerate(MUJOCO_EFFECTS):
            yield Arm(effects=(effect,), seed=seed + 7 * number, truth="mujoco")
        yield Arm(effects=("rolling_resistance", "yaw_rate delay"), seed=seed)
        yield Arm(effects=("payload_mass", "specific_force_x scale"), seed=seed)


def hidden(model: Model, arm: Arm) -> dict[str, float]:
    """Every parameter of the arm's effects with its true value, in the model's names and units."""
    given = arm.values or {}
    return {
        p.name: given.get(
            p.name,
            p.value + p.typical
            if p.shape
            else float(np.clip(p.value + arm.scale * p.typical, p.lower, p.upper)),
        )
        for name in arm.effects
        for p in model.effect(name).parameters
    }


def record(arm: Arm, folder: Path) -> dict[str, float]:
    """Drive the arm on the bench and leave its run directory; returns the true parameters, nuisances included."""
    # a stream apart from the sensors', which begin with the seed alone
    rng = np.random.default_rng([arm.seed, 17])
    off = {name: float(rng.normal(0.0, sd)) for name, sd in SPREAD.items()}
    # of their own, so that the drives stay those of earlier reports
    later = np.random.default_rng([arm.seed, 19])
    off |= {name: float(later.normal(0.0, sd)) for name, sd in LATER_SPREAD.items()}
    # sizes by the model's library, so that `scale` means the same in truth and diagnosis
    effects = {**hidden(loader.model(), arm), **(arm.beside or {})}
    machine, equipment = load_machine("l60"), load_equipment("l60")
    payload = float(rng.choice(PAYLOADS_KG))
    machine = _with_effects(_off_its_sheet(machine, off), effects)
    scenario = drive(arm, rng, payload, replace(equipment, sensors=_sensors(equipment, effects)))
    unit = PlantUnit(machine, scenario, seed=scenario.seed, motion=_motion(arm, machine, scenario))
    bench = Lockstep(unit, ecu_cycle(form="corrected", limits=True))
    started = Choice(scenario=scenario.name).record(scenario, "lockstep")
    folder.mkdir(parents=True, exist_ok=True)
    rundir.refuse_if_foreign(folder)
    rundir.begin(folder, started)
    lost = write_recording(folder, bench.run())
    if lost:
        raise OSError("; ".join(lost))
    rundir.write_record(folder, replace(started, outcome="finished", duration_s=arm.duration_s))
    return {**off, **effects}


def _motion(arm: Arm, machine: Machine, scenario: Scenario) -> Motion:
    speed, payload = scenario.start.speed, scenario.payload_mass
    if arm.truth == "mujoco":
        return MujocoMotion(machine, payload_mass=payload, speed=speed)
    return Plant(
        machine,
        payload_mass=payload,
        speed=speed,
        step_s=STEP_S,
        integrator="rk4" if arm.truth == "rk4" else "semi-implicit",
    )


def drive(arm: Arm, rng: np.random.Generator, payload_kg: float, equipment: Equipment) -> Scenario:
    """A random drive: each few seconds another speed and turn, sometimes the linkage and the brake."""
    end, at = arm.duration_s, 0.0
    start = float(rng.choice(SPEEDS_M_S[2:]))
    speed, turn, brake = [(0.0, start)], [(0.0, 0.0)], [(0.0, 0.0)]
    lift, tilt = [(0.0, 0.0)], [(0.0, 0.0)]
    raised = rolled = 1
    while at < end:
        length = float(rng.uniform(4.0, 7.0))
        wanted, angle = float(rng.choice(SPEEDS_M_S)), float(rng.choice(TURNS_RAD))
        # sharp turns are driven slowly: a drive that rolls over shows nothing of the rest
        slow = 1.5 if abs(angle) > 0.3 else 4.5
        wanted = float(np.clip(wanted, -slow, slow))
        speed += [(at + 1.5, wanted), (at + length, wanted)]
        turn += [(at + 0.3 + abs(angle - turn[-1][1]) / 0.3, angle), (at + length, angle)]
        if rng.random() < 0.5:
            lift += _pulse(at + 1.0, 0.7 * raised, 1.5)
            # up and down in turn: the arm stays between its stops
            raised = -raised
        if rng.random() < 0.4:
            tilt += _pulse(at + 2.0, 0.4 * rolled, 0.8)
            rolled = -rolled
        if rng.random() < 0.25:
            brake += _pulse(at + 0.5 * length, 0.25, 0.6)
        at += length
    script = Script(
        speed=Profile(tuple(speed)),
        articulation_angle=Profile(tuple(turn)),
        brake=Profile(tuple(brake)),
        lift=Profile(tuple(lift)),
        tilt=Profile(tuple(tilt)),
    )
    return Scenario(
        path=Path(f"{arm.name}.toml"),
        name=arm.name,
        sentence="A random drive.",
        duration_s=end,
        machine="l60",
        payload_mass=payload_kg,
        surface=Surface(),
        start=Start(speed=start),
        script=script,
        equipment=equipment,
        seed=arm.seed,
    )


def _pulse(at: float, size: float, length: float) -> list[tuple[float, float]]:
    # ramps of 0.2 s: levers are moved, not switched
    return [(at, 0.0), (at + 0.2, size), (at + length - 0.2, size), (at + length, 0.0)]


def _off_its_sheet(machine: Machine, off: Mapping[str, float]) -> Machine:
    rear, front, tyre = machine.rear_frame, machine.front_frame, machine.tyre
    stiffer = 1.0 + off["tyre_stiffness"]
    return replace(
        machine,
        rear_frame=replace(
            rear, mass=rear.mass + off["rear_mass"], x=rear.x + off["rear_x"], z=rear.z + off["rear_height"]
        ),
        front_frame=replace(front, mass=front.mass + off["front_mass"], x=front.x + off["front_x"]),
        tyre=replace(
            tyre,
            # both terms of the load: the tyre is stiffer at every deflection
            qfz1=tyre.qfz1 * stiffer,
            qfz2=tyre.qfz2 * stiffer,
            radius=tyre.radius + off["wheel_radius"],
            pkx1=tyre.pkx1 * (1.0 + off["slip_stiffness"]),
            pky1=tyre.pky1 * (1.0 + off["cornering_stiffness"]),
        ),
    )


def _with_effects(machine: Machine, values: Mapping[str, float]) -> Machine:
    """The machine with the physics among the hidden effects; `name.parameter` says which."""
    known, chosen = plant_effects(), dict[str, dict[str, float]]()
    for full, value in values.items():
        name, _, parameter = full.partition(".")
        # names of sensors' channels are no effects of the plant; `_sensors` takes them
        if name in known:
            chosen.setdefault(name, {})[parameter] = value
    return replace(machine, effects=tuple(known[name].of(**given) for name, given in chosen.items()))


def _sensors(equipment: Equipment, values: Mapping[str, float]):
    """The sheet's sensors with the faults among the hidden effects: `channel.bias`, `.scale`, `.delay`, `.lag`."""
    fields = {"bias": "bias", "scale": "scale_error", "delay": "delay", "lag": "lag"}
    channels = dict(equipment.sensors.channels)
    for full, value in values.items():
        name, _, kind = full.partition(".")
        if name in channels and kind in fields:
            item: ChannelParameters = channels[name]
            field = fields[kind]
            channels[name] = replace(item, **{field: getattr(item, field) + value})
    return replace(equipment.sensors, channels=channels)
