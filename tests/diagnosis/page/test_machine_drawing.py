"""The machine in the report of a diagnosis: colours are the mismatch of what is measured there, numbers are the findings."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.page.heat import level
from diagnosis.page.machine import PARTS, chapter, places
from discrepancy.decision.evidence import Evidence, MapRow
from discrepancy.models import straight
from discrepancy.models.loader import model as loader
from discrepancy.signals.findings import Findings
from tests.diagnosis.cases import finding


def evidence(*sizes: tuple[str, float, float | None]) -> Evidence:
    """One row of mismatch per channel: constant before and after, with a gap."""

    def flat(size: float) -> np.ndarray:
        return np.array([size, np.nan, size])

    edges = np.arange(4.0)
    rows = [MapRow("r", c, edges, flat(b), None if a is None else flat(a)) for c, b, a in sizes]
    return Evidence([], rows, [], [])


def result(*found, model="loader") -> Findings:
    return Findings(model=model, recordings=["r"], status="explained", reasons=[], findings=list(found))


def parts(markup: str) -> list[dict[str, str]]:
    """What is drawn of each view: title of a part -> class."""
    views = re.findall(r"<svg.*?</svg>", markup, re.DOTALL)
    return [
        {
            t.splitlines()[0].lower(): k
            for k, t in re.findall(r'<g class="part (\w+)"><title>(.*?)</title>', view, re.DOTALL)
        }
        for view in views
    ]


def test_colours_are_those_of_the_mismatch_before_and_after() -> None:
    shown = evidence(
        ("lift_pressure", 4.0, 1.0),
        ("wheel_speed_front_right", 1.6, 1.3),
        ("yaw_rate", 9.0, 2.5),
        ("pitch_rate", 1.0, 1.0),
    )
    side, top, side_after, _ = parts(chapter(result(), shown))
    assert side["lift cylinders"] == f"h{level(4.0)}"
    assert side_after["lift cylinders"] == f"h{level(1.0)}"
    assert side["wheel front right"] == top["wheel front right"] == f"h{level(1.6)}"
    assert side["inertial sensor and inclinometer"] == f"h{level(9.0)}"  # the worst channel of the place
    assert side_after["inertial sensor and inclinometer"] == f"h{level(2.5)}"
    assert side["tilt cylinder"] == "blank"
    assert "wheel front left" not in side
    assert top["wheel front left"] == "blank"


def test_a_baseline_without_findings_is_drawn_once_and_another_machine_not_at_all() -> None:
    assert chapter(result(), evidence(("yaw_rate", 2.0, None))).count("<svg") == 2
    assert chapter(result(model="ball"), evidence(("height", 2.0, None))) == ""


def test_findings_are_numbered_where_they_act_and_described_in_the_tooltip() -> None:
    found = (
        replace(
            finding("payload_mass", "physics", {"payload_mass.extra_kg": 1.0}), sentence="More < than assumed"
        ),
        finding("yaw_rate delay", "sensor", {"yaw_rate.delay": 0.1}),
    )
    markup = chapter(result(*found), evidence(("yaw_rate", 2.0, 1.0)))
    assert "1. payload_mass: More &lt; than assumed" in markup
    assert [places(f) for f in found] == [["bucket"], ["inertial sensor"]]
    first = re.findall(r"<svg.*?</svg>", markup, re.DOTALL)[0]
    assert sorted(re.findall(r"<text[^>]*>(\d)</text>", first)) == ["1", "2"]
    assert "one-step errors" in markup


@pytest.mark.parametrize("model", [loader.model(), straight.model()], ids=lambda m: m.name)
def test_every_channel_and_every_effect_has_its_place(model) -> None:
    for channel in model.outputs:
        at = [key for key, part in PARTS.items() if part.channels and re.fullmatch(part.channels, channel)]
        assert at, channel
        assert len(at) == 1 or channel == "speed"
    for effect in model.effects:
        f = replace(
            finding(effect.name, effect.kind, {p.name: 0.0 for p in effect.parameters}), place=effect.place
        )
        assert places(f), effect.name


def test_bodies_do_not_leave_the_picture() -> None:
    for part in PARTS.values():
        for shape, (low, high) in ((part.side, (-325, 20)), (part.top, (-140, 140))):
            for x, y in re.findall(r"(-?\d+),(-?\d+)", shape):
                assert -300 <= int(x) <= 420
                assert low <= int(y) <= high
