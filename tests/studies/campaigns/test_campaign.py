"""The tables say what the runs gave: errors against truth, counts of the grid, nothing run twice."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bus.frame import EXTENDED, Frame
from dbc import loader_database
from deploy.c.core import C
from ecu.calibration import load_calibration
from ecu.core import PYTHON
from ecu.estimators.signals import Inputs
from hil.compose import Choice, lockstep
from hil.ecu_side import CALIBRATION
from studies.campaigns import false_alarms, roll_over, roll_over_extended
from studies.campaigns.ablation import VARIANTS, estimated, inputs_of
from studies.campaigns.batch import header, markdown_table, results_of
from studies.campaigns.memory import columns_of
from studies.campaigns.normal_force import Case, Series, ablation_table, errors_of, estimates_of, table
from studies.campaigns.roll_over_document import counts, document, failures, spread, summary
from studies.campaigns.roll_over_picture import draw
from tests.deploy.c.building import compiler
from tests.plant.unit.profiles import value

TIME = np.arange(0, 3, 0.01)
STANDING = np.array([10e3, 20e3, 30e3, 40e3])


def truth():
    return np.tile(STANDING, (TIME.size, 1))


def series(error, valid=True):
    force = truth() + np.asarray(error)
    return Series(TIME + 0.006, force, np.full(force.shape, valid))


def test_a_constant_error_is_its_own_rms_per_wheel():
    errors = [100.0, -200.0, 0.0, 50.0]
    result = errors_of(series(errors), TIME, truth())
    assert result["rms"] == pytest.approx([100.0, 200.0, 0.0, 50.0])
    assert result["standing"] == STANDING.tolist()
    assert result["valid"] == 1.0


def test_an_estimate_is_compared_with_the_truth_of_its_own_moment():
    """Truth that rises by 1 N/ms, seen 6 ms late without correction: an error of 6 N."""
    rising = STANDING + 1000.0 * TIME[:, None]
    late = Series(TIME + 0.006, rising, np.ones(rising.shape, bool))
    assert errors_of(late, TIME, rising)["rms"] == pytest.approx([6.0] * 4, abs=0.1)


def test_invalid_frames_do_not_count():
    some = series([100.0, 0.0, 0.0, 0.0])
    some.force[50:60, 0] = 1e6
    some.valid[50:60, 0] = False
    result = errors_of(some, TIME, truth())
    assert result["rms"][0] == pytest.approx(100.0)
    assert result["valid"] < 1.0
    assert np.isnan(errors_of(series(0.0, valid=False), TIME, truth())["rms"]).all()


def test_after_the_first_lift_off_nothing_counts():
    force = truth()
    force[100:, 0] = 0.0
    estimate = force.copy()
    estimate[101:] -= 5e4  # the pull that would hold the wheel down
    result = errors_of(Series(TIME, estimate, np.ones(force.shape, bool)), TIME, force)
    assert result["rms"] == pytest.approx([0.0] * 4)
    assert (result["lifts"], result["until"]) == (True, pytest.approx(1.0))


def test_the_table_gives_newtons_and_percent_of_standing_load():
    result = errors_of(series([100.0, -200.0, 0.0, 50.0]), TIME, truth()) | {"seed": 1}
    text = table([Case("loaded", "corrected")], [result])
    assert (
        "| loaded | corrected | 100 (1.0 %) | 200 (1.0 %) | 0 (0.0 %) | 50 (0.1 %) | 100.0 % | 3 % | yes |"
        in text
    )
    assert "loaderhil campaign normal-force" in text


def test_estimates_repeated_from_the_bus_are_those_the_ecu_sent():
    """The ablation begins with what the estimators were given: nothing taken away gives the frames again."""
    scenario = dataclasses.replace(Choice(scenario="transient_torque").load(), duration_s=1.5)
    recording = lockstep(scenario, limits=False, reference=False).run()
    calibration = load_calibration(CALIBRATION)
    times, inputs = inputs_of(recording.bus, calibration)
    arrival, repeated = estimated(inputs, calibration.parameters, times)["everything"]
    sent = estimates_of(recording)
    at = np.searchsorted(sent.time_s, times[:-1])
    assert len(at) > 140
    assert np.abs(sent.time_s[at] - arrival[:-1]).max() < 1e-3
    assert np.abs(sent.force[at] - repeated[:-1]).max() <= 20.1  # half a bit of the frame


@pytest.mark.slow
def test_a_turn_of_the_grid_has_the_same_result_with_the_ecu_in_c():
    compiler()
    case = roll_over.TUNING.cases()[-1]  # the fastest turn with the load at the top
    found = roll_over.run_case(case, C)
    assert found == roll_over.run_case(case, PYTHON)
    assert found["lift_off_s"] is not None  # or prevention would have had nothing to do


def test_taking_a_source_away_changes_what_it_is_for():
    rows = np.ones((5, len(Inputs._fields)))
    parameters = load_calibration(CALIBRATION).parameters
    deaf, same = VARIANTS["without pressures: no payload"](rows, parameters)
    assert same is parameters
    assert deaf[:, Inputs._fields.index("pressure_usable")].tolist() == [0.0] * 5
    assert deaf.sum() == rows.sum() - 5
    _, changed = VARIANTS["not carried ahead by the latency"](rows, parameters)
    assert changed.contact == parameters.contact._replace(latency=0.0)
    assert set(VARIANTS) >= {"everything"}


def test_the_ablation_has_a_row_per_source_and_a_column_per_drive():
    worst = dict.fromkeys(VARIANTS, 0.0123)
    found = errors_of(series(0.0), TIME, truth()) | {"ablation": worst}
    text = ablation_table([Case("loaded", "corrected"), Case("loaded", "printed")], [found, {}])
    assert "|  | loaded |" in text
    assert text.count("| 1.2 |") == len(VARIANTS)


@dataclass(frozen=True)
class Square:
    side: int
    log: str


def area(case):
    with Path(case.log).open("a") as log:
        log.write(f"{case.side}\n")
    return {"area": case.side**2}


def power(case, exponent):
    with Path(case.log).open("a") as log:
        log.write(f"{exponent}\n")
    return {"power": case.side**exponent}


def test_results_come_in_order_and_no_case_is_run_twice(tmp_path):
    log = tmp_path / "log"
    run = [Square(side, str(log)) for side in (3, 1, 2)]
    assert results_of(run, area, cache=tmp_path / "kept", jobs=1) == [{"area": 9}, {"area": 1}, {"area": 4}]
    more = [*run, Square(5, str(log))]
    assert results_of(more, area, cache=tmp_path / "kept", jobs=1)[-1] == {"area": 25}
    assert sorted(log.read_text().split()) == ["1", "2", "3", "5"]


def test_further_arguments_are_part_of_the_case(tmp_path):
    """Results of one core of the ECU are not taken for those of another."""
    cases = [Square(2, str(tmp_path / "log"))]
    found = [results_of(cases, power, n, cache=tmp_path / "kept", jobs=1) for n in (2, 3)]
    assert found == [[{"power": 4}], [{"power": 8}]]
    assert (tmp_path / "log").read_text().split() == ["2", "3"]


def test_frames_in_memory_decode_as_from_a_log():
    codec = loader_database().by_name["SlopeSensor"]
    frames = [Frame(codec.can_id, codec.encode([0.1, -0.2, 0.0]), 1_500_000_000), Frame(0x7 | EXTENDED, b"")]
    columns = columns_of(frames)["SlopeSensor"]
    assert columns.time_s.tolist() == [1.5]
    assert columns.signals["RollAngle"][0] == pytest.approx(-0.2)


CASES = roll_over.TUNING.cases()


def result(**changes):
    calm = {
        "seed": 8,
        "lift_off_s": None,
        "wheel": None,
        "rolls_over": False,
        "margin": 0.8,
        "lead_s": None,
        "warned": False,
        "false_alarm": False,
        "flickers": 0,
        "printed_lead_s": None,
        "limited_lifts": False,
        "limited_lead_s": None,
        "named_wheel": None,
        "limited_rolls_over": False,
        "limited_margin": 0.8,
    }
    return calm | changes


GOOD = result(
    lift_off_s=3.0, wheel=0, named_wheel=0, margin=0.0, lead_s=0.5, warned=True, printed_lead_s=-0.4
)
LATE = result(lift_off_s=3.0, wheel=1, margin=0.0, lead_s=-0.1, warned=True, limited_lifts=True)
FALSE = result(warned=True, false_alarm=True, flickers=3)
NEAR = result(warned=True, margin=0.2)
RESULTS = [GOOD, LATE, FALSE, NEAR, *[result()] * (len(CASES) - 4)]


@pytest.mark.parametrize("grid", roll_over.GRIDS)
def test_a_grid_has_every_combination_once(grid):
    lists = (grid.speeds_kmh, grid.loads, grid.rates_deg_s, grid.turns_deg)
    assert len(set(grid.cases())) == len(grid.cases()) == np.prod([len(values) for values in lists])


def test_the_confirmation_shares_no_speed_load_or_rate_with_the_tuning():
    one, other = roll_over.TUNING, roll_over.CONFIRMATION
    assert not set(one.speeds_kmh) & set(other.speeds_kmh)
    assert not set(one.loads) & set(other.loads)
    assert not set(one.rates_deg_s) & set(other.rates_deg_s)


@pytest.mark.parametrize("to_deg", [39.0, -28.0])
def test_a_case_becomes_its_scenario(to_deg):
    case = roll_over.Case(18.0, roll_over.Load("raised", 1000.0, 20.0), 13.0, to_deg)
    scenario = roll_over.scenario_of(case)
    assert scenario.start.speed == pytest.approx(5.0)
    assert scenario.payload_mass == 1000.0
    angle = scenario.script.articulation_angle
    slope = (value(angle, 2.5) - value(angle, 2.0)) / 0.5
    assert np.degrees(slope) == pytest.approx(np.copysign(13.0, to_deg))
    assert np.degrees(value(angle, scenario.duration_s)) == pytest.approx(to_deg)


def test_the_summary_counts_what_the_results_hold():
    found = counts(RESULTS)
    assert found == {
        "turns": str(len(CASES)),
        "lift a wheel with the limits off": "2, of which 0 roll over",
        "corrected warning ahead of lift-off": "1 of 2",
        "corrected lead: least, median, most": "-0.10, 0.20, 0.50 s",
        "printed warning ahead of lift-off": "0 of 2",
        "printed lead: least, median, most (negative is late)": "-0.40, -0.40, -0.40 s",
        "printed: never warns": "1 of 2",
        "false alarms among turns that keep more than 30 %": f"1 of {len(CASES) - 3} (1 %)",
        "warned among turns that keep less, without lift-off": "1 of 1",
        "flicker: warnings shorter than 50 ms, not counted": "3 in 1 turns",
        "prevented with the limits on": "1 of 2",
        "roll over with the limits on": f"0 of {len(CASES)}",
    }
    text = summary({"one": RESULTS, "other": RESULTS[:1]})
    assert "|  | one | other |" in text
    assert f"| turns | {len(CASES)} | 1 |" in text


def test_failures_are_listed_and_only_they():
    lines = failures(CASES, RESULTS).splitlines()
    assert len(lines) == 2
    assert "-0.10 s ahead" in lines[0]
    assert "limits on" in lines[0]
    assert "false alarm" in lines[1]
    assert failures(CASES, [result()] * len(CASES)) == "None.\n"


def test_leads_that_do_not_exist_are_left_out():
    assert spread([None, 0.1, 0.3]) == "0.10, 0.20, 0.30 s"
    assert spread([None]) == "–"


def test_document_and_picture_are_reproducible(tmp_path):
    found = [("tuning", "one.svg", CASES, RESULTS)]
    assert document(found) == document(found)
    assert "![Lead over speed and articulation rate](one.svg)" in document(found)
    for name in ("one.svg", "two.svg"):
        draw(CASES, RESULTS, tmp_path / name)
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


OFF_LEVEL = roll_over_extended.EXTENDED.cases()


def test_the_extended_grid_has_every_ground_and_both_sides():
    grid = roll_over_extended.EXTENDED
    lists = (grid.speeds_kmh, grid.loads, grid.rates_deg_s, grid.turns_deg, grid.grounds)
    assert len(set(OFF_LEVEL)) == len(OFF_LEVEL) == np.prod([len(values) for values in lists])
    assert sum(grid.turns_deg) == 0.0


def test_the_ground_of_a_case_is_that_of_its_scenario():
    ground = roll_over.Ground("steep", grade_percent=-15.0, bank_deg=6.0, friction=0.45)
    surface = roll_over.scenario_of(dataclasses.replace(CASES[0], ground=ground)).surface
    assert np.tan(surface.grade) == pytest.approx(-0.15)
    assert np.degrees(surface.bank) == pytest.approx(6.0)
    assert surface.friction == 0.45


def test_only_a_lift_that_was_neither_prevented_nor_warned_of_is_unanswered():
    unanswered = roll_over_extended.unanswered
    assert not unanswered(GOOD)
    assert not unanswered(result(limited_lifts=True, limited_lead_s=0.3))
    assert unanswered(result(limited_lifts=True, limited_lead_s=-0.3))
    assert unanswered(result(limited_lifts=True))


def test_the_extended_page_counts_by_ground_and_names_failures_by_it():
    late = LATE | {"limited_lead_s": -0.1, "named_wheel": 0}
    results = [GOOD, *[result()] * (len(OFF_LEVEL) - 2), late]
    text = roll_over_extended.page(OFF_LEVEL, results, [])
    assert f"Neither prevented nor warned of: **1 of {len(OFF_LEVEL)}** turns" in text
    assert "the ECU named in 1 of 2 turns" in text
    assert f"- {OFF_LEVEL[-1].ground.name}, {OFF_LEVEL[-1].load.name}" in text
    each = len(OFF_LEVEL) // len(roll_over_extended.EXTENDED.grounds)
    assert f"| turns | {each} | {each} |" in text
    half = len(OFF_LEVEL) // 2
    assert f"| turns | {len(OFF_LEVEL)} | {half} | {half} |" in text


def test_the_halves_share_no_turn_nor_its_mirror_and_hold_half_of_every_ground():
    tuned = roll_over_extended.tuning_half(OFF_LEVEL)
    assert tuned == roll_over_extended.tuning_half(OFF_LEVEL)
    for ground in roll_over_extended.EXTENDED.grounds:
        here = [case for case in OFF_LEVEL if case.ground == ground]
        assert 2 * len(tuned & set(here)) == len(here)
    for case in OFF_LEVEL:
        assert (dataclasses.replace(case, to_deg=-case.to_deg) in tuned) == (case in tuned)


REASON = {"slippery": False, "margin": 0.5, "grip": 0.2}


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, false_alarms.FORESEEN),
        ({"slippery": True}, false_alarms.UNKNOWN),
        ({"slippery": True, "grip": 0.95}, false_alarms.SLIDES),
    ],
)
def test_a_false_alarm_is_counted_under_its_cause(changes, name):
    found = REASON | changes
    assert false_alarms.cause(found) == name
    grip = 100 * found["grip"]
    more = found | {"grip": found["grip"] + 0.02, "margin": 0.4}
    expected = f"| {name} | 2 | 40, 45, 50 % | {grip:.0f}, {grip + 1:.0f}, {grip + 2:.0f} % |"
    assert expected in false_alarms.by_cause([found, more])
    others = [line for line in false_alarms.by_cause([found]).splitlines()[2:] if name not in line]
    assert all("| 0 | – | – |" in line for line in others)


def test_an_axle_pushes_with_both_its_wheels():
    along, across, normal = np.array(((0, 0, 3, 3), (4, -4, 4, 4), (10, 10, 10, 30)), float)
    assert false_alarms.axles(along, across, normal) == pytest.approx([0.0, 0.25])


def test_what_an_alarm_on_slippery_ground_shows_is_what_the_turn_shows():
    """The margin is the verdict's; nothing grips better than the ground."""
    load = roll_over.Load("laden", 3204.0, 0.0)
    case = roll_over.Case(22.0, load, 22.5, 39.0, roll_over.Ground("slippery", friction=0.45))
    found = false_alarms.explain(case)
    verdict, _ = roll_over.drive(roll_over.scenario_of(case), "corrected", limits=False)
    assert verdict.false_alarm
    assert found["slippery"]
    assert found["margin"] == pytest.approx(verdict.margin, abs=1e-9)
    assert 0.0 < found["grip"] < 1.1  # the peak of the tyre lies above its sliding friction


def test_the_wheel_the_ecu_named_is_the_last_before_the_lift_off():
    codec = loader_database().by_name["RollOver"]
    names = codec.signals

    def frame(wheel, at_s):
        values = [float(wheel) if name == "LiftingWheel" else 0.0 for name in names]
        return Frame(codec.can_id, codec.encode(values), round(at_s * 1e9))

    messages = columns_of([frame(0, 1.0), frame(3, 2.0), frame(1, 3.0)])
    assert roll_over.named_wheel(messages, 2.5) == 2
    assert roll_over.named_wheel(messages, 1.5) is None
    assert roll_over.named_wheel(messages, None) is None


def test_a_header_names_command_and_commit():
    text = header("Title", "loaderhil campaign x", "seed 1")
    assert "loaderhil campaign x" in text
    assert "at commit" in text


def test_markdown_table():
    assert markdown_table(("a", "b"), [("x", "1")]) == "| a | b |\n| --- | ---: |\n| x | 1 |\n"
