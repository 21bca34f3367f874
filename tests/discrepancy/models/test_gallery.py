"""Models of the gallery: sound descriptions, and the pneumatic cylinder's friction found with its published size."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.exhibits import EXHIBITS, model_and_recordings, model_file
from diagnosis.models import find_model
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings

ALL = slice(None)
ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("exhibit", EXHIBITS, ids=lambda exhibit: exhibit.name)
def test_every_exhibit_has_a_model_and_a_page(exhibit) -> None:  # type: ignore[no-untyped-def]
    model = find_model(str(ROOT / model_file(exhibit))).channels
    assert model.effects
    assert (ROOT / "docs" / "gallery" / f"{exhibit.name}.md").is_file()
    assert f"({exhibit.name}.md)" in (ROOT / "docs" / "gallery" / "README.md").read_text()


def found_in(name: str, recordings: Path, settings: Settings, files: slice = ALL) -> Findings:
    """The findings in an exhibit's files; skips where the data are not there."""
    (exhibit,) = [e for e in EXHIBITS if e.name == name]
    if not (recordings / exhibit.name).is_dir():
        pytest.skip(f"no {exhibit.name} in {recordings}")
    return examine(*model_and_recordings(replace(exhibit, files=exhibit.files[files]), recordings), settings)


@pytest.mark.data
def test_seal_friction_of_the_cylinder_has_its_known_size(recordings: Path) -> None:
    """Half the difference of both stroke directions, by the data's own check: 3.9, 5.4, 6.9, 7.8 N at 1, 3, 5, 7 bar."""
    found = found_in("pneumatic_cylinder", recordings, Settings())
    size = {f.effect: f.parameters[0].value for f in found.findings if f.named}
    bar = np.array([1.0, 3.0, 5.0, 7.0])
    friction = size["seal friction"] + size["seal friction with pressure"] * 1e5 * bar
    np.testing.assert_allclose(friction, [3.9, 5.4, 6.9, 7.8], rtol=0.12)


@pytest.mark.data
@pytest.mark.slow
def test_tanks_that_overflow_are_unknown_with_the_size_and_place_of_the_error(recordings: Path) -> None:
    """The error is slow, so an autoregression takes it for noise; the simulation still misses a third of the movement."""
    found = found_in("cascaded_tanks", recordings, Settings(open_ended=False))
    (level,) = found.adequacy
    assert (found.status, found.named) == ("unknown", [])
    assert level.simulated > 0.3 * level.movement
    # water leaves the upper tank when it is full: the lower one is high then
    worst = max(level.regimes, key=lambda part: part.simulated)
    assert worst.regime.startswith("level above")


@pytest.mark.data
@pytest.mark.slow
def test_friction_of_the_linear_drive_has_its_published_size_at_500_hz(recordings: Path) -> None:
    """Janot, Gautier and Brunot (2019): 203.5 N s/m and 20.4 N. One-step errors of single samples gave 422 and no dry friction."""
    found = found_in("emps", recordings, Settings(open_ended=False, average=True, set_aside="intervals"))
    for effect, published in (("viscous friction", 203.5), ("dry friction", 20.4)):
        assert effect in found.named
        (size,) = found.finding(effect).parameters
        assert size.low is not None
        assert size.high is not None
        assert size.low < published < size.high
    assert any("is sampled at 500 Hz" in complaint.text for complaint in found.complaints)


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_spring_that_stiffens_is_the_one_cause_named_in_the_silverbox(recordings: Path) -> None:
    """Published: the cubic term alone takes the multisine's simulated error from 6.87 to 1.06 mV, by 85 %."""
    found = found_in("silverbox", recordings, Settings(), slice(1, 2))  # the multisine alone
    assert found.named == ["spring that stiffens"]
    (place,) = found.adequacy
    assert place.simulated < 0.15 * place.simulated_before
    (stiffening,) = found.finding("spring that stiffens").parameters
    assert stiffening.value > 0.0


@pytest.mark.data
def test_distances_that_radios_read_too_large_have_their_known_scale(recordings: Path) -> None:
    """Known: 1.069 to 1.070 times, plus up to 0.03 m of some 45 m, so 0.069 to 0.0707 without an offset. All bursts of samples are used."""
    found = found_in("plaza_ranging", recordings, Settings())
    assert found.named == ["scale of the radios"]
    (scale,) = found.findings[0].parameters
    assert scale.low is not None
    assert scale.high is not None
    assert scale.low < 0.0707
    assert scale.high > 0.069
    assert scale.high - scale.low < 0.002
    assert found.samples > 0.95 * 3529


@pytest.mark.data
@pytest.mark.slow
def test_an_arm_that_a_linear_model_explains_gets_no_cause(recordings: Path) -> None:
    """Of the arm's acceleration 8.7 % are unexplained, and dry friction, the likeliest cause, takes that to 8.4 %."""
    assert found_in("qube_pendulum", recordings, Settings()).named == []
