"""Recordings that are wrong in themselves: each is reported, mended where nothing is lost by it, and blamed on no physics."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.blind.hidden import Truth, concealed, staged
from discrepancy.checks.clocks import join
from discrepancy.examine import examine
from discrepancy.models import straight
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording, Signal, cleaned
from discrepancy.signals.resampling import resampled
from tests.discrepancy.toys import record, tank


def verdict(recording: Recording, *effects: str) -> Findings:
    return examine(tank(*effects), [recording], Settings())


def drive(effects: Mapping[str, Mapping[str, float]], seed: int = 1) -> Recording:
    """The straight model's own manoeuvre with these effects hidden in it."""
    model = straight.model()
    truth = Truth(model="straight", seed=seed, effects=effects)
    manoeuvre = model.manoeuvres[0]
    return concealed(model, staged(model, manoeuvre, {}), truth, manoeuvre.initial)


def test_rows_in_no_order_are_sorted_and_a_clock_set_back_is_not() -> None:
    whole = record(8, leak=0.08)
    mixed = np.random.default_rng(0).permutation(whole.signals["level"].time_s.size)
    back = np.concatenate([np.arange(600), np.arange(300, 600), np.arange(900, 1200)])
    for rows, word, kept in ((mixed, "sorted", 1200), (back, "do not advance", 900)):
        taken = {n: Signal(s.time_s[rows], s.value[rows], s.unit, s.held) for n, s in whole.signals.items()}
        clean, complaints = cleaned(Recording("rows", taken))
        assert all(word in c.text for c in complaints)
        assert len(complaints) == 2
        level = clean.signals["level"]
        assert level.time_s.size == kept
        assert np.all(np.isin(level.time_s, whole.signals["level"].time_s))
        assert np.array_equal(
            level.value,
            whole.signals["level"].value[np.searchsorted(whole.signals["level"].time_s, level.time_s)],
        )


def test_stamps_that_count_from_1970_hold_no_value_a_step_too_long() -> None:
    """Such stamps resolve 0.24 µs: a command that comes with a grid point must act from it on."""
    stamps = 1.7e9 + 0.01 * np.arange(5000)
    command = Signal(stamps, np.arange(5000.0), "1", held=True)
    grid = np.nextafter(stamps, 0.0)
    assert np.array_equal(resampled(command, grid), command.value)


def test_a_recording_without_the_channel_that_starts_a_model_is_judged() -> None:
    whole = drive({"acceleration bias": {"acceleration.bias": 0.1}})
    signals = {n: s for n, s in whole.signals.items() if n != "speed"}
    result = examine(straight.model(), [replace(whole, signals=signals)], Settings())
    found = result.finding(
        "acceleration bias"
    )  # alone, or with a slope that only the speed would part from it
    sizes = [e.value for e in (*found.parameters, *(e for m in found.group for e in m.parameters))]
    assert pytest.approx(0.1, rel=0.1) in sizes
    [speed] = result.missing_channels
    assert speed.channel == "speed"
    assert not speed.recorded


def test_a_reversed_sign_outside_the_library_is_reported_and_no_physics() -> None:
    whole = record(3, sign=-1.0)
    result = verdict(whole, "leak", "offset")
    assert result.status == "inconclusive"
    assert "moves opposite to the model's prediction" in result.reasons[0]
    assert verdict(whole).named == ["level sign"]


def test_a_wrongly_scaled_channel_leaves_no_clean_bill() -> None:
    """What the other channels show is judged, but that nothing is missing cannot be said."""
    whole = drive({})
    assert examine(straight.model(), [whole], Settings()).status == "nothing missing"
    speed = whole.signals["speed"]
    wrong = replace(whole, signals={**whole.signals, "speed": replace(speed, value=3.6 * speed.value)})
    result = examine(straight.model(), [wrong], Settings())
    assert result.status == "inconclusive"
    assert "km/h under a heading of m/s" in result.reasons[0]
    assert "in acceleration alone" in result.reasons[1]
    assert [m.recorded for m in result.missing_channels] == [True]
    force = whole.signals["drive_force"]
    alone = replace(whole, signals={**whole.signals, "drive_force": replace(force, value=1e-3 * force.value)})
    reasons = examine(straight.model(), [alone], Settings()).reasons
    assert len(reasons) == 2  # both outputs, and not also that none is there
    assert all("drive_force in kN under a heading of N" in reason for reason in reasons)
    # Another recording shows it. With noise of its own: in a copy of the first one, what noise does by chance is confirmed by held-out data.
    both = examine(straight.model(), [wrong, replace(drive({}, seed=2), name="whole")], Settings())
    assert both.status == "nothing missing"


def test_stamps_in_another_unit_are_suspected() -> None:
    whole = record(3)
    for factor in (1e3, 1e-3):
        taken = {n: replace(s, time_s=factor * s.time_s) for n, s in whole.signals.items()}
        result = verdict(Recording("stamps", taken))
        assert result.status == "inconclusive"
        assert "another unit than its heading says" in result.reasons[0]


@pytest.mark.parametrize("ahead_s", [7.3, -7.3])
def test_a_quarter_of_a_run_between_two_clocks_is_found(ahead_s: float) -> None:
    """Samples beyond the other file's inputs count too: without them a shuttle's next turn, the other way round, fitted better."""
    whole, model = drive({"speed delay": {"speed.delay": 0.15}}), straight.model()
    ahead = {n: replace(s, time_s=s.time_s + ahead_s) for n, s in whole.signals.items() if n in model.outputs}
    parts = [
        Recording("in.log", {n: s for n, s in whole.signals.items() if n in model.inputs}),
        Recording("out.log", ahead),
    ]
    joined = join(model, parts, "run")
    assert joined.offset_s == pytest.approx((0.0, -ahead_s), abs=0.2)
    assert [clock.parameter for clock in joined.clocks] == ["clock of out.log"]
