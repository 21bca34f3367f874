"""When a foreign node was silent: gaps at the beginning, in the middle and at the end count alike."""

import numpy as np
import pytest

from hil.foreign.silence import judge_presence, silences
from hil.verdict import Result

END_S = 2.0
ALWAYS = np.arange(0.0, END_S, 0.01)


def between(from_s, until_s):
    """A node that is silent from one time to another."""
    return ALWAYS[(from_s >= ALWAYS) | (until_s <= ALWAYS)]


@pytest.mark.parametrize(
    ("times", "found"),
    [
        (ALWAYS, []),
        (between(0.5, 0.59), []),
        (between(0.5, 0.7), [(0.5, 0.7, True)]),
        (between(-1.0, 0.3), [(0.0, 0.3, True)]),
        (between(1.5, 9.0), [(1.5, END_S, False)]),
        ([], [(0.0, END_S, False)]),
        (ALWAYS - 5.0, [(0.0, END_S, False)]),
    ],
)
def test_gaps_beyond_100_ms_are_silences(times, found):
    seen = [(round(s.from_s, 3), round(s.until_s, 3), s.ended) for s in silences(times, end_s=END_S)]
    assert seen == found


def test_a_silent_node_fails_and_the_times_are_named():
    assert judge_presence("EstimatorEcu", ALWAYS, end_s=END_S).result is Result.PASSED
    verdict = judge_presence("EstimatorEcu", between(0.5, 0.7), end_s=END_S)
    assert (verdict.result, verdict.reason) == (Result.FAILED, "silent from 0.50 s to 0.70 s")
    assert judge_presence("EstimatorEcu", ALWAYS, end_s=0.0).result is Result.INCONCLUSIVE


@pytest.mark.parametrize(
    ("times", "host_s", "result"),
    [
        (between(0.5, 0.7), 0.11, Result.INCONCLUSIVE),  # 0.1 s are permitted anyway
        (between(0.5, 0.7), 0.05, Result.FAILED),
        # never came back: it may have crashed, and it may be waiting still
        (between(1.5, 9.0), 0.6, Result.INCONCLUSIVE),
        (between(1.3, 9.0), 0.5, Result.FAILED),
        (between(0.2, 9.0), 1.0, Result.FAILED),
    ],
)
def test_only_silences_that_the_host_explains_are_excused(times, host_s, result):
    verdict = judge_presence("EstimatorEcu", times, end_s=END_S, host_s=host_s)
    assert verdict.result is result
    assert ("waiting for up to" in verdict.reason) == (result is Result.INCONCLUSIVE)
