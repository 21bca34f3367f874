"""Delays that all readings of a device have in common."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Window
from discrepancy.model.sensors import device_delay, sensor_effects
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array, Recording
from tests.discrepancy.toys import record, tank

BOTH = ("level", "outflow")


def gauged() -> Model:
    """A tank whose level and outflow are read by one gauge."""
    plain = tank("level delay")

    def simulate(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        level = plain.simulate(window, values, extra)["level"]
        return {"level": level, "outflow": 0.2 * level}

    library: tuple[Effect, ...] = (
        *plain.effects,
        *sensor_effects("outflow", "m/s", bias=0.02, kinds=("delay",)),
        device_delay("gauge", BOTH),
    )
    return replace(plain, outputs={"level": "m", "outflow": "m/s"}, effects=library, simulate=simulate)


def gauge(seed: int, late_s: Mapping[str, float]) -> Recording:
    """Level and outflow, each late by its own time, with noise of its own."""
    found, noise = {}, np.random.default_rng(seed)
    for name, size in (("level", 1.0), ("outflow", 0.2)):
        recording = record(seed, noise=0.0, delay_s=late_s[name])
        read = recording.signals["level"]
        seen = size * read.value + noise.normal(0.0, 0.005 * size, read.value.size)
        found[name] = replace(read, value=seen, unit="m" if name == "level" else "m/s")
    return Recording("gauge", {"inflow": recording.signals["inflow"], **found})


def test_a_device_reads_outputs_of_the_model() -> None:
    with pytest.raises(ValueError, match="gauge delay: inflow, levl is no output; it has level"):
        replace(tank(), effects=(device_delay("gauge", ("level", "levl", "inflow")),))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("level_s", "outflow_s", "names"),
    [(0.2, 0.2, ["gauge delay"]), (0.2, 0.0, ["level delay"]), (0.0, 0.0, [])],
)
def test_a_late_device_is_one_finding(seed: int, level_s: float, outflow_s: float, names: list[str]) -> None:
    recording = gauge(seed, {"level": level_s, "outflow": outflow_s})
    result = examine(gauged(), [recording], Settings(open_ended=False))
    assert result.named == names
    for finding in result.findings:
        (late,) = finding.parameters
        assert late.low is not None
        assert late.high is not None
        half = 0.5 * (late.high - late.low)
        assert half < 0.01
        assert late.value == pytest.approx(0.2, abs=1.5 * half), "three standard deviations"
        assert finding.group == []


def test_a_device_may_be_late_by_more_than_a_sensor() -> None:
    """Half a second is another clock for one reading; for a device whose library says so it is a delay."""
    slow = gauged()
    slow = replace(
        slow,
        effects=(
            *(e for e in slow.effects if "delay" not in e.name),
            device_delay("gauge", BOTH, delay_s=0.5),
        ),
    )
    result = examine(slow, [gauge(1, dict.fromkeys(BOTH, 1.5))], Settings())
    assert result.named == ["gauge delay"]
    assert not [c for c in result.complaints if c.fatal]
