"""The wheel loader with its whole effect library as a Model of the engine: a measurement-driven replay.

Inputs are the measured wheel torques and joint angles. The plant's own equations give the outputs: wheel speeds, inertial readings,
cylinder pressures, and the wheel forces where test instruments recorded them. Feedback draws the speed to the measured one, so that an
error of force shows as a steady difference (plant.replay). Nuisances are what the machine's sheet does not know exactly: masses, height
of the centre of gravity, tyre stiffness, zero points of the sensors.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from discrepancy.model.description import Effect, Model
from discrepancy.models.loader.channels import CHANNELS, INPUTS, LIMITS, OPTIONAL, SPEEDS
from discrepancy.models.loader.library import library
from discrepancy.models.loader.nuisances import NUISANCES
from discrepancy.models.loader.recorded_run import DamagedRecord, load_run
from discrepancy.models.loader.segments import LEAD_S, SCORED_S, choose_segments
from discrepancy.models.loader.simulation import Loader
from discrepancy.signals.recording import Recording
from plant.sheets.machine import Machine, load_machine
from plant.unit.equipment import load_equipment

__all__ = ["DamagedRecord", "load_run", "model"]

STEP_S: Final = 0.01
# Noise of the inputs makes the replay wrong by up to this share of a typical error, however exact the sensors of the outputs are.
FLOOR: Final = 0.2
NEGLIGIBLE: Final = 0.1  # share of a typical change, below which an effect is of no use to an engineer
LEAST_EXPLAINED: Final = 0.05  # share of some channel's squared one-step errors
JACOBIAN_REACH: Final = (
    6.0  # typical changes over which sensitivities are reused: one set takes half a minute
)
PILE_DISTANCE: Final = "pile_entry.distance_m"
MANOEUVRE_CHANNELS: Final = (*SPEEDS[:1], *INPUTS, *OPTIONAL)
"""Channels by which manoeuvres differ, for the choice of segments."""


def model(
    recordings: Sequence[Recording] = (), *, machine: Machine | str = "l60", without: tuple[str, ...] = ()
) -> Model:
    """The loader for these recordings.

    machine: a Machine, or its name or TOML file, with the sensors of its family; without: effects that are not searched.
    """
    sheet = load_machine(machine) if isinstance(machine, str) else machine
    equipment = load_equipment(sheet.family)
    lags = {name: equipment.sensors.of(name).lag for name in CHANNELS}
    noise = {name: equipment.sensors.of(name).noise for name in CHANNELS}
    simulate = Loader(sheet, equipment, recordings)
    return Model(
        name="loader",
        sentence="an articulated wheel loader, driven by its measured torques and joint angles",
        inputs=INPUTS,
        optional=OPTIONAL,
        limits=LIMITS,
        held=tuple(LIMITS),
        outputs={name: channel.unit for name, channel in CHANNELS.items()},
        nuisances=NUISANCES,
        effects=tuple(_started(e, simulate) for e in library() if e.name not in without),
        simulate=simulate,
        step_s=STEP_S,
        window_s=SCORED_S,
        lead_s=LEAD_S,
        segments=lambda recording, interval: choose_segments(recording, interval, SPEEDS, MANOEUVRE_CHANNELS),
        jacobian_reach=JACOBIAN_REACH,
        negligible=NEGLIGIBLE,
        floors={name: FLOOR * channel.typical for name, channel in CHANNELS.items()},
        # a replay by measured torques is late by their smoothing at every step of torque: what an engineer would not mind is adequate
        disturbances={name: channel.typical for name, channel in CHANNELS.items()},
        sensor_noise={name: sd for name, sd in noise.items() if sd > 0.0},
        lags={name: lag for name, lag in lags.items() if lag > 0.0},
        least_explained=LEAST_EXPLAINED,
        threads=True,
        warms_up=True,
    )


def _started(effect: Effect, simulate: Loader) -> Effect:
    """The effect; a pile's distance starts at the place where the recorded machine drove into something."""
    contact = simulate.contact_position(STEP_S) if effect.name == "pile_entry" else None
    if contact is None:
        return effect
    parameters = [
        replace(p, value=contact - p.typical) if p.name == PILE_DISTANCE else p for p in effect.parameters
    ]
    return replace(effect, parameters=tuple(parameters))
