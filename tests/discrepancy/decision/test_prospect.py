"""What a recording that could be made is expected to show, against what it shows when it is made."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.groups import Alternative
from discrepancy.decision.judgement import Judgement
from discrepancy.decision.prospect import Prospect, manoeuvre_recording
from discrepancy.estimation.fit import fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.examine import investigate
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording
from tests.discrepancy.springs import MANOEUVRES, spring, stretched, stretching

SETTINGS = Settings(open_ended=False)


def judged(recording: Recording) -> tuple[Judgement, Alternative, Alternative]:
    """A diagnosis at one amplitude, at which two effects are the same."""
    found = investigate(spring(), [recording], SETTINGS)
    assert isinstance(found, Judgement)
    ((one, other),) = found.groups.values()
    return found, one, other


def prospect(found: Judgement, amplitude: float, duration_s: float) -> Prospect:
    manoeuvre = stretching("test", amplitude, duration_s)
    return Prospect(found.problem, found.state.noise, manoeuvre_recording(found.problem, manoeuvre))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("true", "assumed"), [("cubic", "stiffer"), ("stiffer", "cubic")])
def test_the_recording_shows_what_was_expected_of_it(seed: int, true: str, assumed: str) -> None:
    """The difference in SSE of both explanations, fitted to all recordings, is normal about the expected one: mean E, variance 4 E."""
    present = stretched(seed, **{true: 0.5})
    found, *both = judged(present)
    by_name = {a.effect: a.fit for a in both}
    expected = prospect(found, 1.5, 20.0).left_over(by_name[true], by_name[assumed])
    made = stretched(seed + 100, amplitude=1.5, duration_s=20.0, **{true: 0.5})
    together = Problem(spring(), [present, made])
    noise = Noise(together, found.state.noise.whiteners)
    after = {name: fit(together, noise, f.names, together.start()).sse for name, f in by_name.items()}
    before = {name: f.sse for name, f in by_name.items()}
    shown = (after[assumed] - after[true]) - (before[assumed] - before[true])
    assert expected > 100.0
    # the noise's variance is known from 800 samples, to 5 %
    assert abs(shown - expected) < 3.0 * np.hypot(2.0 * np.sqrt(expected), 0.05 * expected)


def test_nothing_is_expected_of_the_same_manoeuvre_again() -> None:
    found, one, other = judged(stretched(1, cubic=0.5))
    assert prospect(found, 1.0, 40.0).difference(one.fit, other.fit) < 0.5


def test_nothing_is_expected_between_an_explanation_and_itself() -> None:
    found, one, _ = judged(stretched(2, cubic=0.5))
    assert prospect(found, 2.0, 40.0).difference(one.fit, one.fit) == pytest.approx(0.0, abs=1e-9)


def test_more_is_expected_of_a_larger_way_and_of_a_longer_time() -> None:
    found, one, other = judged(stretched(3, cubic=0.5))
    sizes = [
        prospect(found, amplitude, duration_s).difference(one.fit, other.fit)
        for amplitude, duration_s in ((1.2, 20.0), (1.5, 20.0), (2.0, 20.0), (2.0, 60.0))
    ]
    assert sizes == sorted(sizes)


def test_what_the_present_recordings_leave_open_takes_from_the_difference() -> None:
    """The less they say of a rival's size, the more of a new recording a fit of it can follow."""
    found, one, other = judged(stretched(4, cubic=0.5))
    there = prospect(found, 2.0, 20.0)
    sizes = [
        there.left_over(one.fit, replace(other.fit, information=known * other.fit.information))
        for known in (1e6, 1.0, 0.1, 1e-6)
    ]
    assert sizes == sorted(sizes, reverse=True)
    # at one amplitude a size of which nothing is known explains everything
    assert sizes[-1] < 1e-3 * sizes[0]


def test_a_finding_says_which_manoeuvre_distinguishes_its_group() -> None:
    found, one, other = judged(stretched(5, cubic=0.5))
    (finding,) = found.findings.findings
    (separation,) = finding.separate_by
    assert {finding.effect, separation.effect} == {one.effect, other.effect}
    assert separation.manoeuvre == MANOEUVRES[2].sentence  # of equally large ways the longer one
