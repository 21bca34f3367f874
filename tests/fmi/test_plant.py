"""Our plant as an FMU equals the plant; an FMU as plant gives the frames of the plant that it is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from configuration import ConfigurationError
from fmi.archive import FmuError
from fmi.description import read_description
from fmi.export import export, starts_of
from fmi.motion import connected, motion_of
from fmi.quantities import COMMANDS, PLACES, TRUTH, commands_of, numbers_of
from hil.compose import Choice, lockstep
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.truth import Truth
from plant.unit.scenario import load_scenario
from tests.fmi.fmus import Source, Var, built


@pytest.fixture(scope="module", params=[2, 3])
def exported(request, tmp_path_factory) -> Path:
    """The machine of `loaded` as an FMU."""
    file = tmp_path_factory.mktemp("fmu") / "machine.fmu"
    export("l60", file, request.param, starts_of(load_scenario("loaded")))
    return file


def driven(tick: int) -> Commands:
    """Torque, then steering, then brakes."""
    return Commands(
        wheel_torque=(900.0 + tick, 900.0, 800.0, 800.0) if tick < 60 else (0.0,) * 4,
        brake_torque=(0.0,) * 4 if tick < 80 else (500.0,) * 4,
        articulation_rate=0.2 if 20 < tick < 70 else 0.0,
        lift_rate=0.05,
        tilt_rate=-0.02,
    )


def test_every_number_of_the_truth_has_a_name_and_commands_come_back():
    assert len(TRUTH) == Truth.size
    assert PLACES["wheel_speed_rear_left"] == Truth.wheel_speed.at + 2
    assert PLACES["specific_force_y"] == Truth.imu_specific_force.at + 1
    assert commands_of(numbers_of(driven(30))) == driven(30)
    assert len(COMMANDS) == len(numbers_of(driven(0)))


def test_the_exported_plant_is_valid(exported):
    assert validate_fmu(str(exported)) == []


def test_fmpy_simulates_the_exported_plant_as_the_plant_itself_bit_for_bit(exported):
    from fmpy import simulate_fmu

    plant = Plant(load_machine("l60"), Surface(friction=0.6), payload_mass=2500.0, speed=2.0)
    ours = [plant.truth().row]
    times = np.arange(100) * 0.01
    rows = []
    for tick in range(100):
        rows.append((times[tick], *numbers_of(driven(tick))))
        plant.advance(driven(tick), 0.01)
        ours.append(plant.truth().row)
    # held: FMPy interpolates continuous inputs, so each value is given at both ends of its step
    table = np.array(
        [row for at in rows for row in (at, (at[0] + 0.01 - 1e-9, *at[1:]))],
        dtype=[(name, np.float64) for name in ("time", *COMMANDS)],
    )
    outputs = [name for name in TRUTH if name != "time_s"]
    found = simulate_fmu(
        str(exported), stop_time=1.0, step_size=0.01, output_interval=0.01, input=table, output=outputs,
        start_values={"friction": 0.6, "start_payload_mass": 2500.0, "start_speed": 2.0},
    )  # fmt: skip
    theirs = np.array([[row[name] for name in outputs] for row in found])
    np.testing.assert_array_equal(
        theirs, np.array(ours)[:, [i for i, n in enumerate(TRUTH) if n != "time_s"]]
    )


def test_the_exported_plant_in_the_place_of_ours_gives_the_same_frames(exported):
    scenario = replace(load_scenario("loaded"), duration_s=3.0)
    ours = lockstep(scenario).run()
    theirs = lockstep(scenario, fmu=exported).run()
    assert [(f.can_id, f.data, f.at_ns) for f in theirs.bus] == [
        (f.can_id, f.data, f.at_ns) for f in ours.bus
    ]
    assert [f.data for f in theirs.reference] == [f.data for f in ours.reference]
    assert len(ours.bus) > 3000


def test_a_value_out_of_range_is_said_by_the_fmu_in_one_line(exported, tmp_path):
    file = tmp_path / "far.fmu"
    file.write_bytes(exported.read_bytes())
    file.with_suffix(".toml").write_text("[plant.values]\nstart_speed = 99.0\n")
    with pytest.raises(FmuError, match=r"speed=99.0 m/s is outside -30..30 m/s"):
        motion_of(file)


def test_without_its_python_the_fmu_says_what_it_needs(exported, monkeypatch):
    monkeypatch.setenv("LOADERHIL_PYTHON", "/nowhere/python")
    with pytest.raises(FmuError, match="name one by LOADERHIL_PYTHON"):
        motion_of(exported)


OSCILLATOR = Source(  # the equation of Van der Pol, as in the reference FMU of that name
    "VanDerPol",
    (
        Var("torque", "input", 0.0, "N.m"),
        Var("x0", "output", 2.0, "rad", 'initial="exact"'),
        Var("x1", "output", 0.0, "rad/s", 'initial="exact"'),
        Var("fed_through", "output", None, "N.m"),
        Var("mu", "parameter", 1.0),
    ),
    "double a = v[X1], b = v[MU] * (1 - v[X0] * v[X0]) * v[X1] - v[X0]; v[X0] += h * a; v[X1] += h * b; return 0;",
    "v[FED_THROUGH] = v[TORQUE];",
)
GIVEN = ("articulation_angle", "articulation_rate", "wheel_torque_front_left")


def foreign(folder: Path, fmi: int, more: str = "", without: str = "") -> Path:
    from plant.unit.signals import CHANNELS

    file = built(OSCILLATOR, folder, fmi)
    constants = "".join(f"{n} = 0.0\n" for n in CHANNELS if n not in (*GIVEN, without))
    file.with_suffix(".toml").write_text(
        "[plant.inputs]\ntorque = 'wheel_torque_command_front_left'\n"
        "[plant.outputs]\narticulation_angle = 'x0'\narticulation_rate = 'x1'\nwheel_torque_front_left = 'fed_through'\n"
        f"{more}\n[plant.constants]\n{constants}"
    )
    return file


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_foreign_fmu_moves_as_its_equations_say(tmp_path, fmi):
    motion = motion_of(foreign(tmp_path, fmi))
    x0, x1 = 2.0, 0.0
    for tick in range(200):
        motion.advance(Commands(wheel_torque=(float(tick), 0.0, 0.0, 0.0)), 0.01)
        x0, x1 = x0 + 0.01 * x1, x1 + 0.01 * ((1 - x0 * x0) * x1 - x0)
    truth = motion.truth()
    assert (truth.articulation_angle, truth.articulation_rate) == pytest.approx((x0, x1), rel=1e-12)
    assert (truth.wheel_torque[0], truth.time_s) == (199.0, pytest.approx(2.0))
    assert np.isnan(truth.normal_force).all()


def test_the_slope_sensor_of_a_foreign_fmu_feels_its_specific_force(tmp_path):
    """Speeding up by 1 m/s2 looks like climbing, a lateral force of 2 m/s2 to the left like leaning to the right."""
    file = foreign(tmp_path, 2)
    constants = file.with_suffix(".toml")
    text = constants.read_text()
    for axis, value in (("x", 1.0), ("y", 2.0), ("z", 9.81)):
        text = text.replace(f"specific_force_{axis} = 0.0", f"specific_force_{axis} = {value}")
    constants.write_text(text)
    pitch, roll = motion_of(file).truth().inclination
    assert (pitch, roll) == pytest.approx(
        (-np.arcsin(1.0 / np.linalg.norm([1.0, 2.0, 9.81])), np.arctan(2.0 / 9.81))
    )


def test_a_scenario_runs_with_a_foreign_fmu_as_plant(tmp_path, monkeypatch):
    from hil.ending import Ending
    from hil.runs import run_lockstep

    choice = Choice(scenario="unloaded", fmu=foreign(tmp_path, 2), changes=("duration_s=1",))
    result = run_lockstep(choice, tmp_path / "run")
    assert result.ending is Ending.PASSED
    assert result.record.versions["plant"].startswith("vanderpol.fmu sha256 ")


@pytest.mark.parametrize(
    ("more", "without", "error", "message"),
    [
        ("", "lift_pressure", FmuError, "nothing gives what these sensors read: lift_pressure"),
        (
            "roll_rate = 'x2'\n",
            "roll_rate",
            ConfigurationError,
            "plant.outputs.roll_rate names 'x2'.*did you mean",
        ),
        ("role_rate = 'x1'\n", "", ConfigurationError, "names 'role_rate'.*'roll_rate'"),
    ],
)
def test_a_connection_that_is_missing_or_misspelt_is_refused(tmp_path, more, without, error, message):
    file = foreign(tmp_path, 2, more, without)
    with pytest.raises(error, match=message):
        connected(read_description(file), file.with_suffix(".toml"))


def test_another_quantity_is_refused(tmp_path):
    with pytest.raises(FmuError, match="x1 is in rad/s, roll_angle is in rad"):
        motion_of(foreign(tmp_path, 2, "roll_angle = 'x1'\n", "roll_angle"))
