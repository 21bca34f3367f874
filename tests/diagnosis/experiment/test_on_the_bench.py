"""The loader: what a straight drive cannot distinguish, a second drive on the bench does."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagnosis.blind.hidden import Truth
from diagnosis.blind.hidden_run import concealed_run
from diagnosis.blind.seal import seal
from diagnosis.experiment.sites import MANOEUVRES, UNSUITABLE, BenchSite, suitable
from diagnosis.models import find_model
from diagnosis.reading.origin import Base
from diagnosis.sheet import Sheet
from discrepancy.models.loader.segments import LEAD_S, ROLLING, SHORTEST_S
from hil.compose import Choice, lockstep
from hil.rundir import REFERENCE
from plant.sheets.machine import MACHINES
from plant.unit.scenario import FOLDER, list_scenarios, load_scenario
from tests.diagnosis.cases import Call, loaderhil

__all__ = ["loaderhil"]

STRAIGHT = """
name = "straight"
sentence = "Straight ahead at 10 km/h with an empty bucket."
duration_s = 24.0
machine = "l60"
seed = 21
[start]
speed_kmh = 10.0
[driver.speed_kmh]
points = [[0.0, 10.0], [8.0, 10.0], [9.0, 11.0], [16.0, 11.0], [17.0, 10.0]]
"""


@pytest.fixture
def dragging(tmp_path: Path) -> tuple[Path, Path]:
    """A straight drive of a machine in service whose brakes drag, and the sealed truth."""
    scenario = tmp_path / "straight.toml"
    scenario.write_text(STRAIGHT)
    drag = {"brake_drag.front_N_m": 500.0, "brake_drag.rear_N_m": 500.0}
    truth = Truth(model="loader", seed=41, effects={"brake_drag": drag})
    run = tmp_path / "run"
    concealed_run(Choice(scenario=str(scenario)), truth, run)
    (run / REFERENCE).unlink()
    sealed = tmp_path / "truth.sealed"
    sealed.write_text(seal(truth, [run]))
    return run, sealed


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_dragging_brakes_are_a_group_until_a_second_drive(
    dragging: tuple[Path, Path], tmp_path: Path, loaderhil: Call
) -> None:
    """Without load or speed, brakes that drag and tyres that resist rolling are one and the same torque."""
    run, sealed = dragging
    folder = tmp_path / "next"
    words = ("--model", "loader", "--scenario", "coast_down_loaded", "--most", 1)
    ended = loaderhil("experiment", run, *words, "--sealed", sealed, folder=folder)
    first, second = json.loads((folder / "experiment.json").read_text())["rounds"]
    assert sorted(first["groups"][0]) == ["brake_drag", "rolling_resistance"]
    assert first["chosen"] == "coast_down_loaded"
    assert [f["effect"] for f in second["findings"]] == ["brake_drag"]
    assert (second["resolved"], ended.code) == (True, 0)
    assert not (folder / "round-1" / "coast_down_loaded" / REFERENCE).exists()


@pytest.mark.parametrize("file", sorted(MANOEUVRES.glob("*.toml")), ids=lambda file: file.stem)
def test_every_manoeuvre_is_a_scenario_with_a_name_of_its_own(file: Path) -> None:
    scenario = load_scenario(file)
    assert scenario.sentence.endswith(".")
    assert scenario.name not in {s.name for s in list_scenarios()}


@pytest.mark.slow
@pytest.mark.parametrize("file", suitable(), ids=lambda file: file.stem)
def test_in_no_manoeuvre_that_is_offered_a_wheel_is_nearly_lifted(file: Path) -> None:
    """There the replay is not adequate, and the verdict becomes less sure by the very recording that should settle it."""
    truth = lockstep(load_scenario(file), form="corrected", limits=True, reference=False).run().truth
    loads = np.array([row.normal_force for row in truth])
    assert (loads.min(axis=0) > 0.3 * loads[0]).all()
    wheels = np.abs([row.wheel_speed for row in truth])
    assert np.mean(wheels.min(axis=1) > ROLLING) * len(truth) * 0.01 > LEAD_S + SHORTEST_S


def test_what_is_left_out_are_scenarios_of_the_bench() -> None:
    assert {path.stem for path in FOLDER.glob("*.toml")} > UNSUITABLE


def test_the_scenario_is_written_for_the_machine_of_the_recordings(tmp_path: Path) -> None:
    """Beside the other scenarios a machine of a site may lie anywhere, under any name."""
    machine = tmp_path / "the site's" / "mine.toml"
    machine.parent.mkdir()
    machine.write_text((MACHINES / "l60.toml").read_text())
    site = BenchSite(find_model("loader"), Base(machine), Sheet.DATASHEET, ["coast_down"])
    (manoeuvre,) = site.manoeuvres()
    assert load_scenario(site.write(manoeuvre, tmp_path)).machine == str(machine)
