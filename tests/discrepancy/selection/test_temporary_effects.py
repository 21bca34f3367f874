"""Effects that act in one interval only, from the recording to the verdict."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from diagnosis.describe import alternatives
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.room import KNOWN, STEP_S, evening, room
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def verdict(recording: Recording, *effects: str) -> Findings:
    return examine(tank(*effects), [recording], STRICT)


def leaking(
    seed: int, *spells: tuple[float, float], leak: float, memory: float = 0.0, duration_s: float = 240.0
) -> Recording:
    """A leak in some intervals of time, under noise with this memory; each step of the truth is exact."""
    tight = record(seed, duration_s=duration_s)
    inflow, level = tight.signals["inflow"], tight.signals["level"]
    now, true = 0.5, np.empty(level.time_s.size)
    for i, (t, u) in enumerate(zip(level.time_s.tolist(), inflow.value.tolist(), strict=True)):
        true[i] = now
        rate = 0.2 + leak * any(start <= t < end for start, end in spells)
        now = u / rate + (now - u / rate) * np.exp(-0.1 * rate)
    white = np.random.default_rng(seed + 100).normal(0.0, 0.02, true.size)
    seen = true + lfilter([1.0], [1.0, -memory], white)
    return replace(tight, signals={"inflow": inflow, "level": signal(level.time_s, seen, "m")})


def leaking_from_66_to_133_s(seed: int) -> Recording:
    """A leak of 0.2 that begins and ends within windows, under noise that remembers a twentieth of it after 60 samples."""
    return leaking(seed, (66.0, 133.0), leak=0.2, memory=0.95)


@pytest.mark.parametrize("seed", [1, 4])
@pytest.mark.parametrize("leak", [0.05, 0.2])
def test_an_effect_that_comes_again_is_found_in_each_of_its_intervals(seed: int, leak: float) -> None:
    """Over one range that spans both, it would be a leak of half the size that blocks of time disagree on."""
    recording = leaking(seed, (40.0, 100.0), (180.0, 260.0), leak=leak, duration_s=300.0)
    result = verdict(recording, "leak", "level scale", "level bias")
    assert result.named == ["leak"]
    found = result.findings[0]
    assert found.parameters[0].value == pytest.approx(leak, rel=0.05)
    first, again = found.where.intervals
    assert (first.start_s, first.end_s) == pytest.approx((40.0, 100.0), abs=0.2)
    assert (again.start_s, again.end_s) == pytest.approx((180.0, 260.0), abs=0.2)
    assert not found.where.throughout
    assert found.where.temporary
    assert alternatives(found) == "leak, only from 40 to 100 s and from 180 to 260 s"
    assert alternatives(found, several=True).startswith("leak, only tank from 40 to 100 s")


def test_an_effect_that_acts_for_a_while_is_found_in_its_windows_with_its_size() -> None:
    """A leak of 0.05 from 60 to 120 s of 200 s, windows of 20 s; over the whole recording it is no constant leak."""
    tight, leaking = record(9, duration_s=200.0), record(9, duration_s=200.0, leak=0.05)
    time_s = tight.signals["level"].time_s
    acting = (time_s >= 60.0) & (time_s < 120.0)
    level = np.where(acting, leaking.signals["level"].value, tight.signals["level"].value)
    result = verdict(replace(tight, signals={**tight.signals, "level": signal(time_s, level, "m")}), "leak")
    assert result.named == ["leak"]
    found = result.findings[0]
    assert not found.where.throughout
    assert found.where.intervals[0].start_s == pytest.approx(60.0, abs=0.2)
    assert found.where.intervals[0].end_s == pytest.approx(120.0, abs=0.2)
    assert found.parameters[0].value == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_is_not_taken_for_what_acts_for_a_while_nor_a_rival_in_the_same_windows(seed: int) -> None:
    """An offset or a bias in the same windows score better at first: noise that was estimated without the leak holds most of it."""
    result = verdict(leaking_from_66_to_133_s(seed))
    assert result.named == ["leak"]
    (interval,) = result.findings[0].where.intervals
    assert interval.start_s == pytest.approx(66.0, abs=10.0)
    assert interval.end_s == pytest.approx(133.0, abs=20.0)
    assert result.findings[0].parameters[0].value == pytest.approx(0.2, rel=0.3)


@pytest.mark.parametrize(
    ("upper", "known", "may"), [(2.0, 0.02, True), (1.1, 0.02, False), (2.0, 0.01, False)]
)
def test_what_acts_for_a_while_is_no_cause_where_the_baseline_may_have_changed(
    upper: float, known: float, may: bool
) -> None:
    """The tank is 1.15 times as wide from 60 to 120 s: its scale seems to be wrong there, which the nuisance would explain as well.

    Not where its bound excludes that, nor where the area is known to a hundredth: fifteen standard deviations are another tank.
    """
    narrow = record(9, duration_s=200.0)
    inflow, level = narrow.signals["inflow"], narrow.signals["level"]
    now, true = 0.5, np.empty(level.time_s.size)
    for i, (t, u) in enumerate(zip(level.time_s.tolist(), inflow.value.tolist(), strict=True)):
        true[i] = now
        wide = 1.15 if 60.0 <= t < 120.0 else 1.0
        now = u / wide / 0.2 + (now - u / wide / 0.2) * np.exp(-0.02)
    seen = true + np.random.default_rng(1).normal(0.0, 0.02, true.size)
    changed = replace(narrow, signals={"inflow": inflow, "level": signal(level.time_s, seen, "m")})
    model = tank("leak", "level scale")
    area, state = model.nuisances
    area = replace(area, upper=upper, prior_sd=known)
    result = examine(replace(model, nuisances=(area, state)), [changed], STRICT)
    assert (result.status == "unknown") is may
    assert (result.named == []) is may
    assert any("nuisance area" in caveat for f in result.findings for caveat in f.caveats) is may


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("leak", [20.0, 40.0])
def test_what_opens_half_way_is_no_noise_with_a_long_memory(seed: int, leak: float) -> None:
    """A thermometer that reads too much until then, or none at all, was said: to a noise that remembers hours, the leak was no surprise.

    With the heat that the walls lose until then, another value of the sheet does as much; but not where that would be 13 standard deviations.
    """
    recording = evening(seed, leak=leak, leak_from=720, off=KNOWN)
    result = examine(room("leak", "weak heater"), [recording], Settings(open_ended=False))
    [found] = result.findings
    assert found.effect == "leak"
    assert found.parameters[0].value == pytest.approx(leak, rel=0.05)
    [spell] = found.where.intervals
    assert found.where.temporary
    assert (spell.start_s, spell.end_s) == pytest.approx((720 * STEP_S, 1439 * STEP_S), abs=2.0 * STEP_S)
    assert found.named or "the nuisance loss would explain as much" in found.caveats[0]


def test_an_effect_that_acts_always_is_given_no_spell() -> None:
    result = verdict(record(9, duration_s=200.0, leak=0.05), "leak")
    assert result.named == ["leak"]
    assert result.findings[0].where.throughout
