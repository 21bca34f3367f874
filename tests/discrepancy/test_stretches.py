"""What of a loader's recording is scored."""

import numpy as np

from discrepancy.models.stretches import LEAD_S, MOST_S, ROLLING, SCORED_S, stretches
from discrepancy.recording import Recording, signal

TIME_S = 0.02 * np.arange(30_000)


def recording(speed, torque=None):
    signals = {"wheel": signal(TIME_S, speed, "rad/s")}
    if torque is not None:
        signals["torque"] = signal(TIME_S, torque, "N.m")
    return Recording("drive", signals)


def of(given):
    return stretches(given, (0.0, float(TIME_S[-1])), ("wheel",), ("wheel", "torque"))


def test_wheels_roll_through_every_stretch_and_its_lead_in():
    speed = 4.0 * np.sin(2.0 * np.pi * TIME_S / 40.0)
    found = of(recording(speed))
    assert found == sorted(found)
    for low, high in found:
        assert np.all(np.abs(speed[(low - LEAD_S <= TIME_S) & (high >= TIME_S)]) > ROLLING)


def test_ten_minutes_are_scored_in_about_a_minute_that_has_the_rare_manoeuvre():
    """One pull in ten minutes of even driving is chosen, wherever it is."""
    torque = np.where((TIME_S > 431.0) & (TIME_S < 433.0), 9e3, 100.0)
    found = of(recording(np.full(TIME_S.size, 3.0), torque))
    assert sum(high - low for low, high in found) <= MOST_S + SCORED_S
    assert any(low < 432.0 < high for low, high in found)


def test_a_recording_in_which_nothing_rolls_is_cut_without_choosing():
    found = of(recording(np.zeros(TIME_S.size)))
    assert found
    assert sum(high - low for low, high in found) <= MOST_S + SCORED_S
