"""Nothing is wired to one machine: each drives with its own equipment and the ECU calibration of its family."""

import numpy as np
import pytest

from ecu.calibration import load_calibration
from hil.compose import Choice, calibration_of, lockstep
from hil.judgement import first_warning
from hil.verdict import first_lift_off
from plant.sheets import machine as sheets
from plant.sheets.machine import family_of, load_machine
from plant.unit.equipment import load_equipment
from studies.campaigns.memory import columns_of
from studies.campaigns.normal_force import errors_of, estimates_of

MACHINES = pytest.mark.parametrize("machine", sorted(file.stem for file in sheets.MACHINES.glob("*.toml")))


def drive(machine, scenario, *, limits, payload_kg=None):
    choice = Choice(scenario=scenario, changes=(f"machine={machine}",), payload_kg=payload_kg)
    recording = lockstep(choice.load(), limits=limits, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    return recording, time, np.array([truth.normal_force for truth in recording.truth])


@MACHINES
def test_a_scenario_takes_the_equipment_and_the_calibration_of_its_machine(machine):
    scenario = Choice(scenario="standstill", changes=(f"machine={machine}",)).load()
    family = family_of(machine)
    assert calibration_of(scenario) == family == load_calibration(family).name
    assert scenario.equipment == load_equipment(family)


@MACHINES
def test_the_calibration_has_the_masses_of_its_machine(machine):
    """The ECU's lumps and the plant's bodies are written down apart; to the rounding of the lumps."""
    known, true = load_calibration(family_of(machine)).parameters, load_machine(machine)
    lumps = (known.front, known.arm, known.bucket, known.rear, known.axle)
    assert sum(lump.mass for lump in lumps) == pytest.approx(true.mass, rel=1e-3)
    assert known.geometry.front_length + known.geometry.rear_length == pytest.approx(
        true.geometry.front_axle_x - true.geometry.rear_axle_x
    )
    assert known.geometry.articulation_stop == pytest.approx(true.steering.limit)


@MACHINES
@pytest.mark.parametrize("scenario", ["hard_braking", "loaded"])
def test_normal_forces_are_estimated_within_three_per_cent(machine, scenario):
    """RMS of each wheel against what it carries standing."""
    payload = load_machine(machine).payload.reference_mass if scenario == "loaded" else 0.0
    recording, time, force = drive(machine, scenario, limits=False, payload_kg=payload)
    found = errors_of(estimates_of(recording), time, force)
    assert max(np.array(found["rms"]) / found["standing"]) < 0.03
    assert found["valid"] > 0.99


@MACHINES
def test_roll_over_is_announced_and_prevented(machine):
    """The abrupt turn lifts a wheel with the limits off, after the warning; with the limits on, none."""
    free, time, force = drive(machine, "abrupt_articulation", limits=False)
    lift, warned = first_lift_off(time, force), first_warning(columns_of(free.bus))
    assert lift is not None
    assert warned is not None
    assert warned < lift[0]
    _, time, force = drive(machine, "abrupt_articulation", limits=True)
    assert first_lift_off(time, force) is None
