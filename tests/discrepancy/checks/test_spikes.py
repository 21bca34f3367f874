"""Glitches of inputs."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.checks.spikes import spikes
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording
from tests.discrepancy.toys import record, tank


def struck(recording: Recording, at: list[int], size: float) -> Recording:
    """The inflow reads so much for single samples."""
    inflow = recording.signals["inflow"]
    value = inflow.value.copy()
    value[at] = size
    return replace(recording, signals={**recording.signals, "inflow": replace(inflow, value=value)})


@pytest.mark.parametrize("seed", range(5))
def test_an_input_that_steps_has_no_glitch(seed: int) -> None:
    """The pump's command changes every 2.5 s, by up to its whole range."""
    assert list(spikes(tank(), record(seed))) == []


def test_a_glitch_of_an_input_is_reported_with_its_time_and_size() -> None:
    wrong = struck(record(1, leak=0.05), [210, 700], -40.0)
    (complaint,) = spikes(tank(), wrong)
    assert (complaint.signal, complaint.fatal) == ("inflow", False)
    times = ", ".join(f"{wrong.signals['inflow'].time_s[i]:.6g}" for i in (210, 700))
    assert f"at {times} s, first to -40 m/s" in complaint.described
    rest = np.delete(wrong.signals["inflow"].value, [210, 700])
    assert (
        f"all other readings keep from {rest.min():.3g} to {rest.max():.3g}"
        in complaint.described.replace(" m/s", "")
    )
    assert any(c.signal == "inflow" for c in examine(tank("leak"), [wrong], Settings()).complaints)


def test_a_signal_of_pulses_has_no_glitches() -> None:
    """A valve that opens for one sample in thirty is no error."""
    pulsed = struck(record(1), list(range(5, 1200, 30)), 20.0)
    assert list(spikes(tank(), pulsed)) == []


def test_a_short_command_within_the_range_is_no_glitch() -> None:
    assert list(spikes(tank(), struck(record(1), [310], 0.9))) == []


def test_an_impulse_on_an_input_that_stands_still_is_no_glitch() -> None:
    """It may be the experiment, and the input has no range to be beyond."""
    good = record(1)
    still = replace(good.signals["inflow"], value=np.zeros(good.signals["inflow"].value.size))
    assert (
        list(spikes(tank(), struck(replace(good, signals={**good.signals, "inflow": still}), [310], 5.0)))
        == []
    )


@pytest.mark.parametrize("seed", range(5))
def test_an_input_with_heavy_tails_has_no_glitches(seed: int) -> None:
    """Noise of Student with 2 degrees of freedom: its farthest readings are beyond the whole range of nearly all."""
    good = record(seed)
    inflow = good.signals["inflow"]
    noise = 0.3 * np.random.default_rng(seed).standard_t(2.0, inflow.value.size)
    noisy = replace(good, signals={**good.signals, "inflow": replace(inflow, value=inflow.value + noise)})
    assert np.max(np.abs(noise)) > np.ptp(np.quantile(noise, [0.01, 0.99]))
    assert list(spikes(tank(), noisy)) == []


def test_a_jump_that_stays_is_none() -> None:
    longer = struck(record(1), [300, 301, 302, 303], -40.0)
    assert list(spikes(tank(), longer)) == []
    short = replace(
        longer,
        signals={k: replace(s, time_s=s.time_s[:50], value=s.value[:50]) for k, s in longer.signals.items()},
    )
    assert list(spikes(tank(), short)) == []
    assert np.isfinite(longer.signals["inflow"].value).all()
