"""Which segments of a loader's recording are scored."""

import numpy as np

from discrepancy.models.loader.segments import LEAD_S, MOST_S, ROLLING, SCORED_S, choose_segments
from discrepancy.signals.recording import Recording, signal

TIME_S = 0.02 * np.arange(30_000)


def recording(speed, torque=None):
    signals = {"wheel": signal(TIME_S, speed, "rad/s")}
    if torque is not None:
        signals["torque"] = signal(TIME_S, torque, "N.m")
    return Recording("drive", signals)


def chosen(given):
    return choose_segments(given, (0.0, float(TIME_S[-1])), ("wheel",), ("wheel", "torque"))


def test_wheels_roll_through_every_segment_and_its_lead_in():
    speed = 4.0 * np.sin(2.0 * np.pi * TIME_S / 40.0)
    found = chosen(recording(speed))
    assert found == sorted(found)
    for low, high in found:
        assert np.all(np.abs(speed[(low - LEAD_S <= TIME_S) & (high >= TIME_S)]) > ROLLING)


def test_the_minute_scored_of_ten_contains_the_rare_manoeuvre():
    """One pull in ten minutes of even driving is chosen, wherever it is."""
    torque = np.where((TIME_S > 431.0) & (TIME_S < 433.0), 9e3, 100.0)
    found = chosen(recording(np.full(TIME_S.size, 3.0), torque))
    assert sum(high - low for low, high in found) <= MOST_S + SCORED_S
    assert any(low < 432.0 < high for low, high in found)


def test_a_recording_without_rolling_is_cut_without_a_choice():
    found = chosen(recording(np.zeros(TIME_S.size)))
    assert found
    assert sum(high - low for low, high in found) <= MOST_S + SCORED_S
