"""Times of the detection end in the same cycle in single and in double precision."""

import numpy as np
import pytest

from ecu.detection.changes import HELD
from ecu.detection.detector import LONGEST
from ecu.detection.isolation import QUIET, RECOVERY, WINDOW
from ecu.detection.jumps import EXPLAINED
from ecu.detection.live import REPLACED_S
from ecu.detection.machine import over, remaining
from ecu.detection.residuals import FORGOTTEN

LIMITS = (EXPLAINED, WINDOW, FORGOTTEN, REPLACED_S, RECOVERY, HELD, QUIET, LONGEST)


def cycles(limit: float) -> int:
    """The reference: whole cycles of 10 ms, counted."""
    return round(limit * 100.0)


@pytest.mark.parametrize("number", [np.float32, np.float64])
@pytest.mark.parametrize("limit", LIMITS)
def test_a_time_that_adds_up_is_over_in_its_cycle(number, limit):
    """Compared to the last bit, single precision needs a cycle more for most of them and double one more for 10 s."""
    time, dt = number(0.0), number(0.01)
    for count in range(1, cycles(limit) + 1):
        time = number(time + dt)
        assert over(time, limit) == (count == cycles(limit))


@pytest.mark.parametrize("number", [np.float32, np.float64])
@pytest.mark.parametrize("limit", LIMITS)
def test_a_time_that_runs_down_is_gone_in_its_cycle(number, limit):
    left, dt = number(limit), number(0.01)
    for count in range(1, cycles(limit) + 1):
        left = number(remaining(left, dt))
        assert (left == 0.0) == (count == cycles(limit))


@pytest.mark.parametrize("number", [np.float32, np.float64])
def test_late_cycles_count_as_many_as_they_are(number):
    generator = np.random.default_rng(4)
    for _ in range(50):
        time, left, counted = number(0.0), number(RECOVERY), 0
        while counted < cycles(RECOVERY):
            late = int(generator.integers(1, 11))
            counted += late
            time, left = number(time + number(late * 0.01)), number(remaining(left, number(late * 0.01)))
            assert over(time, RECOVERY) == (left == 0.0) == (counted >= cycles(RECOVERY))
