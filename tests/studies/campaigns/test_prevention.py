"""Random drives against the limits: what is drawn, how wrong calibrations are, how lift-offs are counted and explained."""

import dataclasses
import json
import random
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from deploy.c.core import C
from deploy.c.library import COMPILERS
from ecu.calibration import load_calibration
from ecu.core import PYTHON
from hil.compose import plant_unit
from hil.ending import Ending
from hil.lockstep import Lockstep
from hil.results import ending_of
from hil.verdict import Result
from studies.campaigns import prevention
from studies.campaigns.manoeuvres import DRY, KINDS, drawn, manoeuvre, scenario_of, straight
from studies.campaigns.prevention import Driven, LiftOff
from studies.campaigns.wrong_calibration import MASS, PLACE, RADIUS, STIFFNESS, wrong_calibration
from tests.plant.unit.profiles import value

RIGHT = load_calibration("l60")
KEPT = {
    "lifts": False, "rolls_over": False, "wheel": None, "lead_s": None, "margin": 0.4, "lift_offs": [], "cause": "",
    "called_faulty": [],
}  # fmt: skip


def lifting(*causes):
    worst = max(causes, key=prevention.CAUSES.index)
    found = [[2.0 + k, 2.1 + k, 0, cause] for k, cause in enumerate(causes)]
    return KEPT | {"lifts": True, "wheel": 0, "margin": 0.0, "lift_offs": found, "cause": worst}


def test_every_kind_is_drawn_as_often_and_a_seed_gives_the_same_drives():
    some = drawn(60, 5)
    assert {kind: sum(m.kind == kind for m in some) for kind in KINDS} == dict.fromkeys(KINDS, 10)
    assert some == drawn(60, 5)
    assert some != drawn(60, 6)
    assert 0.2 < sum(m.calibration_seed is None for m in some) / 60 < 0.8


@pytest.mark.parametrize("kind", KINDS)
def test_every_drive_is_a_scenario_that_lasts_beyond_its_last_demand(kind):
    draw = random.Random(3)
    for _ in range(5):
        m = manoeuvre(kind, draw)
        scenario = scenario_of(m)
        script = scenario.script
        last = max(p.points[-1][0] for p in (script.articulation_angle, script.lift, script.tilt) if p)
        assert scenario.duration_s >= last + 2.4
        assert scenario.payload_mass == m.payload_kg
        assert scenario.surface.friction == m.friction


def test_the_ground_alone_has_neither_steering_nor_levers():
    script = scenario_of(straight(manoeuvre("levers", random.Random(1)))).script
    assert script.lift is None
    assert script.tilt is None
    assert {value(script.articulation_angle, t / 10) for t in range(80)} == {0.0}


@pytest.mark.parametrize("seed", range(20))
def test_a_wrong_calibration_is_wrong_within_its_errors(seed):
    p, right = wrong_calibration("l60", seed).parameters, RIGHT.parameters
    for part in ("front", "rear", "axle", "arm", "bucket"):
        assert getattr(p, part).mass == pytest.approx(getattr(right, part).mass, rel=MASS)
        assert getattr(p, part).mass != getattr(right, part).mass
    for part in ("front", "rear"):
        assert getattr(p, part).x == pytest.approx(getattr(right, part).x, abs=PLACE)
        assert getattr(p, part).z == pytest.approx(getattr(right, part).z, abs=PLACE)
    assert p.wheel.unloaded_radius == pytest.approx(right.wheel.unloaded_radius, rel=RADIUS)
    assert p.wheel.radial_linear == pytest.approx(right.wheel.radial_linear, rel=STIFFNESS)
    assert p.wheel.friction == right.wheel.friction
    assert p == wrong_calibration("l60", seed).parameters


def test_drawn_errors_fill_their_ranges():
    """Uniform: of forty draws the largest lies in the outer fifth, on either side."""
    ratios = [
        wrong_calibration("l60", s).parameters.rear.mass / RIGHT.parameters.rear.mass - 1 for s in range(40)
    ]
    assert max(ratios) > 0.8 * MASS
    assert min(ratios) < -0.8 * MASS


STEERED = LiftOff(3.0, 3.1, 1)


def steered(**changes):
    some = dataclasses.replace(drawn(1, 1)[0], calibration_seed=4, friction=0.5, angle_deg=20.0)
    return dataclasses.replace(some, **changes)


@pytest.mark.parametrize(
    ("lifting_drives", "cause"),
    [
        (lambda m: True, prevention.GROUND),
        (lambda m: m.angle_deg != 0.0 and m.calibration_seed is not None, prevention.CALIBRATION),
        (lambda m: m.angle_deg != 0.0 and m.friction < DRY, prevention.SLIPPERY),
        (lambda m: m.angle_deg != 0.0, prevention.UNEXPLAINED),
    ],
)
def test_a_lift_off_is_explained_by_what_takes_it_away(lifting_drives, cause, monkeypatch):
    monkeypatch.setattr(prevention, "lift_offs", lambda m, *_: [STEERED] if lifting_drives(m) else [])
    assert prevention.causes_of(steered(), [STEERED]) == [cause]


@pytest.mark.parametrize(
    ("by_ground", "explained"),
    [
        ([LiftOff(3.0, 3.1, 1)], True),
        ([LiftOff(2.9, 2.95, 1)], True),
        ([LiftOff(3.1, 3.2, 1)], True),
        ([LiftOff(2.2, 3.4, 1)], True),
        ([LiftOff(2.5, 2.6, 1)], False),
        ([LiftOff(3.4, 3.6, 1)], False),
        ([LiftOff(3.0, 3.1, 2)], False),
        ([], False),
    ],
)
def test_the_ground_explains_a_lift_off_of_the_same_wheel_at_the_same_time(by_ground, explained, monkeypatch):
    monkeypatch.setattr(prevention, "lift_offs", lambda m, *_: [STEERED] if m.angle_deg else by_ground)
    m = steered(calibration_seed=None, friction=DRY)
    assert prevention.causes_of(m, [STEERED]) == [prevention.GROUND if explained else prevention.UNEXPLAINED]


def carries(share):
    """A drive in which the lifted wheel has this share of its load at its lift-off, and its whole load long before and after."""
    time_s = np.arange(0.0, 6.0, 0.01)
    loads = np.ones((time_s.size, 4))
    loads[np.abs(time_s - 3.05) < 0.03, STEERED.wheel] = share
    return Driven(time_s, loads)


@pytest.mark.parametrize(
    ("by_turn", "by_ground", "explained"),
    [
        (0.6, 0.3, True),  # both take more than there is
        (0.9, 0.14, True),  # the step alone takes all but the floor
        (0.9, 0.16, False),  # together they leave something: what lifted it is neither
        (0.14, 0.05, False),  # the limits did not keep their floor
        (0.5, 0.6, False),
    ],
)
def test_turn_and_ground_explain_what_they_take_together(by_turn, by_ground, explained):
    assert prevention.adds_up(STEERED, carries(by_turn), carries(by_ground), 0.15) is explained


def test_what_another_wheel_or_another_time_loses_explains_nothing():
    other, later = LiftOff(3.0, 3.1, 2), LiftOff(4.0, 4.1, 1)
    assert not prevention.adds_up(other, carries(0.3), carries(0.1), 0.15)
    assert not prevention.adds_up(later, carries(0.3), carries(0.1), 0.15)


@pytest.mark.parametrize("step", [0.0, 0.15])
def test_only_a_drive_over_a_step_has_ground_and_turn_together(step, monkeypatch):
    monkeypatch.setattr(prevention, "lift_offs", lambda m, *_: [STEERED] if m.angle_deg else [])
    # on the step, straight, the wheel keeps a tenth; without the step a half
    monkeypatch.setattr(prevention, "shares", lambda m, *_: carries(0.1 if m.left_m else 0.5))
    m = steered(calibration_seed=None, friction=DRY, left_m=step)
    assert prevention.causes_of(m, [STEERED]) == [prevention.TOGETHER if step else prevention.UNEXPLAINED]


def test_every_lift_off_of_a_drive_has_its_own_cause(monkeypatch):
    first, second = LiftOff(1.3, 1.5, 0), STEERED
    monkeypatch.setattr(prevention, "lift_offs", lambda m, *_: [first, second] if m.angle_deg else [first])
    m = steered(calibration_seed=None, friction=DRY)
    assert prevention.causes_of(m, [first, second]) == [prevention.GROUND, prevention.UNEXPLAINED]


def test_a_calibration_explains_nothing_where_another_lift_off_comes_without_it(monkeypatch):
    other = LiftOff(4.0, 4.1, 3)
    monkeypatch.setattr(
        prevention,
        "lift_offs",
        lambda m, *_: [] if not m.angle_deg else [STEERED] if m.calibration_seed else [other],
    )
    assert prevention.causes_of(steered(friction=DRY), [STEERED]) == [prevention.UNEXPLAINED]


def test_only_what_a_limit_could_keep_down_fails():
    cases = drawn(len(KINDS), 1)
    found = [KEPT for _ in cases]
    found[KINDS.index("kerb")] = lifting(prevention.GROUND)
    suite = prevention.suite_of(cases, found)
    assert {case.result for case in suite.cases} == {Result.PASSED}
    assert ending_of(case.result for case in suite.cases) is Ending.PASSED
    found[KINDS.index("slope")] = lifting(prevention.UNEXPLAINED)
    assert ending_of(case.result for case in prevention.suite_of(cases, found).cases) is Ending.FAILED
    assert (
        ending_of(case.result for case in prevention.suite_of(cases[:2], found[:2]).cases)
        is Ending.INCONCLUSIVE
    )


def test_the_page_counts_lift_offs_and_says_how_to_repeat_them():
    cases = drawn(12, 9)
    found = [lifting(prevention.GROUND), lifting(prevention.UNEXPLAINED), *[KEPT] * 10]
    text = prevention.page(cases, found, [{"lifts": True}] * 3, 9)
    assert "loaderhil campaign prevention --runs 12 --seed 9" in text
    assert "Of 12 drives **2** lift a wheel. Of 3 that were also driven without limits 3 lift one." in text
    assert "| all | 12 | 2 | 0 | 1 | 0 | 0.40 | 0.00 |" in text
    assert f"| {prevention.UNEXPLAINED} | 1 | 1 |" in text


def test_a_sound_sensor_that_is_called_faulty_fails_and_is_on_the_page():
    cases = drawn(12, 9)
    wrong = KEPT | {"called_faulty": ["pitch or roll at 2.31 s"]}
    suite = prevention.suite_of(cases, [*[KEPT] * 11, wrong])
    (failed,) = [case for case in suite.cases if case.result is Result.FAILED]
    assert (failed.name, failed.reason) == ("no sound sensor is called faulty", "in 1 of 12 drives one is")
    text = prevention.page(cases, [*[KEPT] * 11, wrong], [], 9)
    assert (
        f"In 1 of 12 drives.\n\n- {cases[11].kind}, drive 12, all wheels down: pitch or roll at 2.31 s"
        in text
    )


def test_findings_of_the_detection_are_read_from_the_drive():
    """A gyro that is off by far is called faulty in the same way as a sound one would be."""
    m = dataclasses.replace(drawn(1, 1)[0], calibration_seed=None, speed_kmh=6.0, angle_deg=12.0)
    assert prevention.called_faulty(prevention.driven(m, limits=True)[1]) == []
    scenario = scenario_of(m)
    sensors = scenario.equipment.sensors
    shifted = dataclasses.replace(sensors.of("yaw_rate"), bias=0.5)
    equipment = dataclasses.replace(
        scenario.equipment,
        sensors=dataclasses.replace(sensors, channels=sensors.channels | {"yaw_rate": shifted}),
    )
    unit = plant_unit(dataclasses.replace(scenario, equipment=equipment))
    found = Lockstep(unit, prevention.ecu_of(m, scenario, limits=True), reference=False).run()
    assert any(line.startswith("yaw_rate at ") for line in prevention.called_faulty(found))


def test_a_drive_counts_with_the_last_cause_and_each_of_its_lift_offs_with_its_own():
    text = prevention.causes_table([lifting(prevention.GROUND, prevention.UNEXPLAINED, prevention.GROUND)])
    assert f"| {prevention.GROUND} | 2 | 0 |" in text
    assert f"| {prevention.UNEXPLAINED} | 1 | 1 |" in text


def test_the_command_gives_verdicts_for_machines(monkeypatch, tmp_path):
    import typer

    from loaderhil.result_commands import campaign_prevention

    suite = prevention.suite_of(drawn(6, 1), [lifting(prevention.SLIPPERY), *[KEPT] * 5])
    monkeypatch.setattr(prevention, "run_campaign", lambda out, **_: (tmp_path / "page.md", suite))
    app = typer.Typer()
    app.command()(campaign_prevention)
    done = CliRunner().invoke(app, ["--json", "--junit", str(tmp_path / "x.xml"), "--runs", "6"])
    assert done.exit_code == Ending.FAILED
    assert json.loads(done.stdout)["suites"][0]["cases"][0]["result"] == "FAILED"
    assert b"levers: no wheel lifts" in (tmp_path / "x.xml").read_bytes()


def test_a_drawn_drive_is_the_same_with_the_ecu_in_c():
    """With a calibration that was drawn, whose C was compiled for this drive."""
    if not any(map(shutil.which, COMPILERS)):
        pytest.skip("no C compiler")
    m = dataclasses.replace(drawn(1, 1)[0], calibration_seed=3)
    (ours, by_c), (theirs, by_python) = (prevention.driven(m, limits=True, core=core) for core in (C, PYTHON))
    assert by_c.bus == by_python.bus
    assert ours == theirs


def test_a_drive_with_a_wrong_calibration_runs():
    m = dataclasses.replace(drawn(1, 1)[0], calibration_seed=3, speed_kmh=6.0, angle_deg=12.0)
    verdict, recording = prevention.driven(m, limits=True)
    assert not verdict.lifted
    assert len(recording.truth) > 400
