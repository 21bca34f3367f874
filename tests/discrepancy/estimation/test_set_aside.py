"""Outliers and intervals that nothing explains are set aside with their time, and rule nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import NOTHING, lone_readings, too_early, wrong_readings
from discrepancy.examine import examine
from discrepancy.model.windows import Block
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings, State
from discrepancy.signals.recording import Recording, Signal
from tests.discrepancy.toys import record, tank

BRIEF = Settings(open_ended=False, set_aside="intervals")
UNASKED = Settings(open_ended=False)


def with_errors(recording: Recording, error: np.ndarray) -> Recording:
    level = recording.signals["level"]
    wrong = Signal(level.time_s, level.value + error, level.unit, level.held)
    return replace(recording, signals={**recording.signals, "level": wrong})


def with_outliers(recording: Recording, share: float, seed: int = 1) -> tuple[Recording, np.ndarray]:
    """Readings off by 15 to 150 standard deviations of the noise."""
    rng, size = np.random.default_rng(seed), recording.signals["level"].value.size
    error = np.where(
        rng.random(size) < share, rng.choice([-1.0, 1.0], size) * rng.uniform(0.3, 3.0, size), 0.0
    )
    return with_errors(recording, error), np.flatnonzero(error)


def with_a_bad_contact(recording: Recording, start_s: float, end_s: float) -> Recording:
    time_s = recording.signals["level"].time_s
    rng, acts = np.random.default_rng(1), (time_s >= start_s) & (time_s < end_s)
    return with_errors(recording, acts * (0.3 * np.sin(7.0 * time_s) + rng.normal(0.0, 0.3, time_s.size)))


def searched(recording: Recording) -> State:
    return search(Problem(tank(), [recording]), BRIEF)[0]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hundredth_of_outliers_does_not_widen_an_interval(seed: int) -> None:
    """Without outliers 0.0005 wide to each side; with them ruling the noise, eight times that."""
    clean = record(seed, leak=0.01)
    spoilt, _ = with_outliers(clean, 0.01)
    one, other = (examine(tank(), [r], BRIEF).finding("leak").parameters[0] for r in (clean, spoilt))
    assert other.low is not None
    assert one.low is not None
    assert other.low < 0.0105
    assert other.value - other.low < 1.3 * (one.value - one.low)
    assert other.value == pytest.approx(one.value, abs=one.value - one.low)


def test_outliers_are_set_aside_and_hardly_anything_else() -> None:
    """Over ten recordings: one outlier in ten may hide in the noise, and one row in 300 go with them."""
    outliers = missed = lost = rows = 0
    for seed in range(3, 13):
        spoilt, at = with_outliers(record(seed), 0.01)
        times = spoilt.signals["level"].time_s[at]
        aside = searched(spoilt).aside.intervals
        found = np.concatenate([np.linspace(s.start_s, s.end_s, s.rows) for s in aside])
        hits = sum(np.min(np.abs(found - time)) < 0.05 for time in times)
        outliers, missed = outliers + times.size, missed + times.size - hits
        lost, rows = lost + found.size - hits, rows + spoilt.signals["level"].time_s.size
    assert missed <= outliers / 10
    assert lost <= rows / 300


@pytest.mark.parametrize("memory", [0.0, 0.8])
@pytest.mark.parametrize("leak", [0.0, 0.2])
def test_a_clean_recording_loses_no_row(memory: float, leak: float) -> None:
    """White and coloured noise, nothing missing and four typical changes missing."""
    state = searched(record(5, memory=memory, leak=leak))
    assert state.aside == NOTHING
    assert state.noise.set_aside == ()


def test_an_interval_that_nothing_explains_is_reported_with_its_time() -> None:
    found = examine(tank(), [with_a_bad_contact(record(1, leak=0.03), 42.0, 47.0)], BRIEF)
    (complaint,) = found.complaints
    start, end = (float(part) for part in complaint.text.split("from ")[1].split(" s:")[0].split(" to "))
    assert start == pytest.approx(42.0, abs=1.0)
    assert end == pytest.approx(47.0, abs=1.5)
    leak = found.finding("leak").parameters[0]
    assert leak.low is not None
    assert leak.high is not None
    assert leak.low < 0.03 + 0.0006
    assert leak.high > 0.03 - 0.0006
    assert found.named == ["leak"]


def test_nothing_missing_is_not_said_of_a_recording_with_such_an_interval() -> None:
    found = examine(tank(), [with_a_bad_contact(record(1), 42.0, 47.0)], BRIEF)
    assert found.status == "unknown"
    assert "not understood from" in found.reasons[0]


def test_an_effect_that_acts_for_a_while_is_no_such_interval() -> None:
    """The level reads 0.2 m too much for a window and a half: the library has a bias."""
    recording = record(1)
    time_s = recording.signals["level"].time_s
    raised = with_errors(recording, 0.2 * ((time_s >= 40.0) & (time_s < 60.0)))
    rows = sum(interval.rows for interval in searched(raised).aside.intervals)
    assert rows <= 2


def test_what_fills_more_than_a_tenth_is_the_noise() -> None:
    assert searched(with_a_bad_contact(record(1), 40.0, 60.0)).aside == NOTHING


@pytest.mark.parametrize("seed", [1, 2])
def test_single_wrong_readings_are_set_aside_without_being_asked(seed: int) -> None:
    spoilt, at = with_outliers(record(seed, leak=0.01), 0.01)
    found = examine(tank(), [spoilt], UNASKED)
    assert found.named == ["leak"]
    (complaint,) = found.complaints
    count = int(complaint.text.removeprefix("has ").split(" ")[0])
    # two that happen to follow one another are kept
    assert 0.9 * at.size <= count <= at.size


@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_knock_moves_is_no_wrong_reading(seed: int) -> None:
    """Noise with memory that is knocked a few times: as large errors of prediction as outliers make, but the level returns slowly."""
    recording = record(seed, memory=0.9)
    rng, size = np.random.default_rng(seed), recording.signals["level"].value.size
    knocks = np.where(rng.random(size) < 0.01, rng.uniform(0.3, 1.0, size), 0.0)
    knocked = with_errors(recording, lfilter([1.0], [1.0, -0.9], knocks))
    assert search(Problem(tank(), [knocked]), UNASKED)[0].aside == NOTHING


def test_an_interval_stays_unless_asked_for() -> None:
    assert search(Problem(tank(), [with_a_bad_contact(record(1), 42.0, 47.0)]), UNASKED)[0].aside == NOTHING


def noisy(seed: int = 1, rows: int = 200) -> np.ndarray:
    """A residual (n, 1) with a slow error of 20 standard deviations of its noise."""
    slow = 0.2 * np.sin(2.0 * np.pi * np.arange(rows) / rows)
    return (slow + np.random.default_rng(seed).normal(0.0, 0.01, rows))[:, None]


def test_of_a_wrong_reading_and_what_was_predicted_from_it_the_reading_alone_is_out() -> None:
    """Beside a slow error, where the reading's own residual does not stand out."""
    residual = noisy()
    residual[70] += 0.3
    flagged = np.isin(np.arange(200), [70, 71, 72])
    (found,) = wrong_readings([residual], [flagged])
    assert np.flatnonzero(found).tolist() == [70]


def test_readings_that_jump_about_are_no_single_wrong_one() -> None:
    """The largest goes there and back as well; with it mended the others are still far off."""
    residual = noisy()
    residual[70:80, 0] += 0.3 * np.resize([1.0, -1.0], 10) * np.linspace(1.0, 1.5, 10)
    flagged = np.isin(np.arange(200), range(70, 80))
    (found,) = wrong_readings([residual], [flagged])
    assert not found.any()


def test_a_wrong_reading_among_the_first_rows_is_seen_and_a_step_is_not() -> None:
    """They have no past to be predicted from: four rows, of a noise of order four."""
    wrong, moved = noisy(2), noisy(3)
    wrong[2] += 0.3
    moved[2:] += 0.3
    first, second = too_early([wrong, moved], 4)
    assert np.flatnonzero(first).tolist() == [2]
    assert not second.any()


@pytest.mark.parametrize("seed", [1, 2])
def test_an_expensive_model_is_searched_once_without_its_wrong_readings(seed: int) -> None:
    """They are found at the baseline, where the leak is still missing; the interval is that of the clean recording."""
    costly, clean = replace(tank("leak"), jacobian_reach=1.0), record(seed, leak=0.01)
    spoilt, at = with_outliers(clean, 0.01)
    whole, without = (examine(costly, [r], UNASKED) for r in (clean, spoilt))
    one, other = (result.finding("leak").parameters[0] for result in (whole, without))
    assert one.low is not None
    assert other.low is not None
    assert other.value - other.low < 1.3 * (one.value - one.low)
    assert other.value == pytest.approx(one.value, abs=one.value - one.low)
    assert whole.complaints == []
    (said,) = without.complaints
    assert said.signal == "level"
    assert f"{at.size} single readings" in said.text


def two_sensors(rows: int, seed: int = 5) -> tuple[list[Block], np.ndarray]:
    """Two channels on one grid and a third on another, 10 ms later, all white."""
    time_s, rng = 0.05 * np.arange(rows), np.random.default_rng(seed)
    blocks = [Block(0, 0, ("a", "b"), time_s, 0), Block(0, 1, ("c",), time_s + 0.01, 2 * rows)]
    return blocks, rng.normal(size=3 * rows)


def lone(blocks: list[Block], residual: np.ndarray) -> list[tuple[str, int]]:
    own = [residual[b.start : b.stop].reshape(b.shape) for b in blocks]
    return [(reading.channels[0], row) for _, row, reading in lone_readings(blocks, own)]


def test_a_reading_is_wrong_where_one_sensor_alone_goes_there_and_back() -> None:
    """A blow to the machine is felt by two sensors, of one message or of two; what moves a sensor for good stays moved."""
    blocks, residual = two_sensors(400)
    assert lone(blocks, residual) == []
    residual[2 * 100] += 60.0  # a
    residual[2 * 400 + 250] -= 60.0  # c
    assert lone(blocks, residual) == [("a", 100), ("c", 250)]
    felt_beside = residual.copy()
    felt_beside[2 * 100 + 1] += 30.0  # b
    assert lone(blocks, felt_beside) == [("c", 250)]
    felt_elsewhere = residual.copy()
    felt_elsewhere[2 * 251] += 30.0  # a, at the time of c's
    assert lone(blocks, felt_elsewhere) == [("a", 100)]
    moved = residual.copy()
    moved[2 * 100 : 2 * 400 : 2] += 60.0
    assert lone(blocks, moved) == [("c", 250)]


@pytest.mark.parametrize(
    ("size", "beside", "found"),
    [(9.0, 0.0, False), (15.0, 0.0, True), (15.0, 6.0, True), (15.0, 10.0, False), (900.0, 10.0, True), (900.0, 25.0, False)],
)  # fmt: skip
def test_how_far_off_a_wrong_reading_is_and_how_quiet_the_others_are(
    size: float, beside: float, found: bool
) -> None:
    """In unit noise a row is sqrt(1.5) from its neighbours' middle: 5 x 1.96 of it are 12. Another channel may have two thirds of that, or a fiftieth of the reading."""
    blocks, residual = two_sensors(2000)
    residual[2 * 995 : 2 * 1006] = 0.0
    residual[2 * 1000 : 2 * 1000 + 2] = size, beside
    assert lone(blocks, residual) == ([("a", 1000)] if found else [])


def test_a_sensor_that_often_jumps_has_no_wrong_readings() -> None:
    """A fifteenth of the readings of c are ten times as far off as the others: so it is, and the farthest of them is no fault."""
    blocks, residual = two_sensors(400)
    own = np.random.default_rng(6)
    residual[2 * 400 :] *= np.where(own.random(400) < 1.0 / 15.0, 10.0, 1.0)
    assert lone(blocks, residual) == []
