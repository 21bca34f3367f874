"""Injected faults change what they say and nothing else."""

import random

import numpy as np
import pytest

from ecu.watched import COUNT, PLACE
from studies.faults.injected import LASTS, SETTLE, SPIKE_EVERY, spoilt

TICKS = SETTLE + LASTS + 50
SAMPLES = np.random.default_rng(1).standard_normal((TICKS, COUNT))
HEARD = np.ones((TICKS, COUNT), np.int64)
DURING = slice(SETTLE, SETTLE + LASTS)


@pytest.mark.parametrize("kind", ["offset", "drift", "spike", "freeze", "noise", "swap"])
def test_a_fault_changes_its_signals_while_it_lasts_only(kind):
    place = PLACE["wheel_speed_1"]
    changed, wrong = spoilt(SAMPLES, HEARD, kind, place, 2.0, random.Random(2))
    other = [k for k in range(COUNT) if k not in wrong]
    assert (changed[:, other] == SAMPLES[:, other]).all()
    assert (changed[:SETTLE] == SAMPLES[:SETTLE]).all()
    assert (changed[DURING.stop :] == SAMPLES[DURING.stop :]).all()
    assert (changed[DURING, wrong] != SAMPLES[DURING, wrong]).any()


def test_a_spike_comes_once_in_so_many_samples():
    changed, _ = spoilt(SAMPLES, HEARD, "spike", 3, 2.0, random.Random(2))
    assert (changed[:, 3] != SAMPLES[:, 3]).sum() == LASTS // SPIKE_EVERY


def test_a_frozen_signal_keeps_its_first_sample():
    changed, _ = spoilt(SAMPLES, HEARD, "freeze", 3, 0.0, random.Random(2))
    assert set(changed[DURING, 3]) == {SAMPLES[SETTLE, 3]}
