"""What of a recording is used, and what is said of the rest."""

from dataclasses import replace

import numpy as np

from discrepancy.estimation.problem import Problem
from discrepancy.signals.recording import Recording
from tests.discrepancy.toys import record, tank


def without(recording: Recording, left_out: np.ndarray) -> Recording:
    """The recording without some samples of its level."""
    level = recording.signals["level"]
    kept = replace(level, time_s=level.time_s[~left_out], value=level.value[~left_out])
    return replace(recording, signals={**recording.signals, "level": kept})


def test_samples_between_gaps_are_counted_as_not_used() -> None:
    """Of the second half six samples come and six are lost: six in a row say nothing."""
    whole = record(1)
    time_s = whole.signals["level"].time_s
    second = time_s > time_s[time_s.size // 2]
    gaps = without(whole, second & (np.arange(time_s.size) % 12 > 5))
    (complaint,) = Problem(tank(), [gaps]).complaints
    there = gaps.signals["level"].time_s.size
    lost = int(np.count_nonzero(gaps.signals["level"].time_s > time_s[time_s.size // 2]))
    said = complaint.text.split(" samples")[0].split(" of ")
    assert int(said[1]) == there
    assert abs(int(said[0]) - lost) <= 6  # those of the block in which the gaps begin


def test_what_a_model_does_not_score_is_no_loss() -> None:
    """A lead-in and segments that are not chosen are the model's business, and no gap of the recording."""
    whole = record(1)
    start, end = (float(whole.signals["level"].time_s[at]) for at in (0, -1))
    assert Problem(tank(), [whole]).complaints == ()
    third = (start + (end - start) / 3.0, start + 2.0 * (end - start) / 3.0)
    some = replace(tank(), window_s=None, segments=lambda recording, interval: [third], lead_s=2.0)
    assert Problem(some, [whole]).complaints == ()
