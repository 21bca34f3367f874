"""Where the evidence of a finding lies."""

from dataclasses import replace

import numpy as np

from discrepancy.decision.location import densest
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def verdict(recording: Recording, *effects: str) -> Findings:
    return examine(tank(*effects), [recording], STRICT)


def test_location_points_at_the_half_in_which_the_sensor_was_late() -> None:
    good, late = record(6, duration_s=160.0), record(6, duration_s=160.0, delay_s=0.4)
    half = good.signals["level"].time_s < 80.0
    mixed = np.where(half, good.signals["level"].value, late.signals["level"].value)
    broken = replace(
        good, signals={**good.signals, "level": signal(good.signals["level"].time_s, mixed, "m")}
    )
    result = verdict(broken)
    assert result.named == ["level delay"]
    where = result.findings[0].where
    assert not where.throughout
    assert where.temporary
    assert where.intervals[0].start_s > 60.0
    assert where.intervals[0].share > 0.7


def test_the_densest_stretch_is_found() -> None:
    assert densest(np.array([-1.0, 2.0, 3.0, -1.0, 2.0, -5.0])) == (1, 5)


def test_evidence_that_happens_to_lie_in_one_part_makes_no_temporary_effect() -> None:
    """The inflow stops after a third: a leak acts on, and hardly shows."""
    filling, still = record(6, duration_s=240.0, leak=0.1), {}
    for name, s in filling.signals.items():
        low = s.value * np.where(s.time_s < 80.0, 1.0, np.exp(-0.3 * (s.time_s - 80.0)))
        still[name] = replace(s, value=low) if name == "inflow" else s
    rng, level, now = np.random.default_rng(3), [], 0.5
    for inflow in still["inflow"].value.tolist():
        level.append(now + 0.02 * rng.normal())
        now = inflow / 0.3 + (now - inflow / 0.3) * np.exp(-0.1 * 0.3)
    still["level"] = signal(filling.signals["level"].time_s, np.array(level), "m")
    result = verdict(replace(filling, signals=still), "leak", "level delay")
    assert result.named == ["leak"]
    where = result.findings[0].where
    assert where.intervals[0].end_s < 120.0
    assert not where.temporary
