"""A strong effect is not taken for another clock or unit, and neither of them for an effect."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.checks.channel_checks import failing_channels
from discrepancy.estimation.problem import Problem, Unusable
from discrepancy.examine import usable
from discrepancy.model.description import Effect, Model, Parameter
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.clock_or_effect import still_blamed
from discrepancy.signals.recording import Recording, signal

TIME_S = 0.1 * np.arange(2_000)
SLOW, QUICK = 2.0 * np.pi / 24.0, 2.0 * np.pi / 15.0
ACROSS = Effect(
    name="across",
    sentence="what lags the input by a quarter of its period",
    equation="",
    parameters=(Parameter(name="across", unit="1", lower=-10.0, upper=10.0, typical=0.5),),
    kind="physics",
    place="plate",
    excited_by="turning",
)


def along(time_s):
    return np.sin(SLOW * time_s) + np.sin(QUICK * time_s)


def across(time_s):
    return np.cos(SLOW * time_s) + QUICK / SLOW * np.cos(QUICK * time_s)


def plate(*effects: Effect) -> Model:
    """Reads its input, and with the effect a multiple of the input's rate of change."""
    return Model(
        name="plate",
        sentence="a plate that turns",
        inputs={"turned": "rad"},
        outputs={"tilt": "rad"},
        nuisances=(Parameter(name="zero", unit="rad", typical=0.1, prior_sd=0.01),),
        effects=(*effects, *sensor_effects("tilt", "rad", bias=0.1)),
        simulate=lambda window, values, extra: {
            "tilt": window["turned"] + values["zero"] + values.get("across", 0.0) * across(window.time_s)
        },
        step_s=0.1,
    )


def recorded(size: float, late_s: float = 0.0, noise: float = 0.02) -> Recording:
    read = along(TIME_S - late_s) + size * across(TIME_S - late_s)
    read = read + noise * np.random.default_rng(4).normal(size=TIME_S.size)
    turned = along(TIME_S)
    return Recording("drive", {"turned": signal(TIME_S, turned, "rad"), "tilt": signal(TIME_S, read, "rad")})


def blamed(model: Model, drive: Recording) -> list[str]:
    return [c.signal for c in usable(model, [drive])[1]]


@pytest.mark.parametrize(("size", "noise"), [(1.5, 0.02), (3.0, 0.02), (-3.0, 0.02), (3.0, 1.0)])
def test_a_strong_effect_of_the_library_is_no_other_clock(size: float, noise: float) -> None:
    """With much noise the effect leaves a share of the channel too, and still less than the shift."""
    drive = recorded(size, noise=noise)
    assert [c.signal for c in failing_channels(Problem(plate(ACROSS), [drive]))] == ["tilt"]
    assert blamed(plate(ACROSS), drive) == []


def test_without_the_effect_in_the_library_the_clock_is_asked_about() -> None:
    with pytest.raises(Unusable, match="another clock"):
        usable(plate(), [recorded(3.0)])


def test_an_effect_beyond_its_bounds_explains_nothing() -> None:
    (amplitude,) = ACROSS.parameters
    small = replace(ACROSS, parameters=(replace(amplitude, lower=-1.0, upper=1.0),))
    with pytest.raises(Unusable, match="another clock"):
        usable(plate(small), [recorded(3.0)])


@pytest.mark.parametrize(("late_s", "noise"), [(4.0, 0.02), (8.0, 0.02), (4.0, 0.2)])
def test_another_clock_is_no_effect(late_s: float, noise: float) -> None:
    with pytest.raises(Unusable, match="another clock"):
        usable(plate(ACROSS), [recorded(0.0, late_s, noise)])


@pytest.mark.parametrize(("second_s", "asked"), [(4.0, ["tilt", "turn"]), (6.0, [])])
def test_one_column_of_stamps_is_not_wrong_by_two_times(second_s: float, asked: list[str]) -> None:
    """Two readings that fit at different shifts have one clock, so that it is the model that is wrong."""
    one = plate()
    both = replace(
        one,
        outputs={"tilt": "rad", "turn": "rad"},
        simulate=lambda window, values, extra: dict.fromkeys(
            ("tilt", "turn"), window["turned"] + values["zero"]
        ),
    )
    drive = recorded(0.0, 4.0)
    other = recorded(0.0, second_s).signals["tilt"]
    problem = Problem(both, [replace(drive, signals={**drive.signals, "turn": other})])
    suspected = failing_channels(problem)
    assert [c.signal for c in suspected] == ["tilt", "turn"]
    assert [c.signal for c in still_blamed(problem, suspected)] == asked


STIFFER = replace(
    ACROSS,
    name="stiffer",
    parameters=(Parameter(name="cube", unit="1/rad2", lower=-100.0, upper=100.0, typical=1.0),),
)
IN_DEGREES = np.degrees(1.0)


def spring(*effects: Effect) -> Model:
    """Reads its input, and with the effect its third power, which is much more."""
    return replace(
        plate(*effects),
        simulate=lambda window, values, extra: {
            "tilt": window["turned"] + values["zero"] + values.get("cube", 0.0) * window["turned"] ** 3
        },
    )


def drive_of(reading) -> Recording:
    read = reading(along(TIME_S)) + 0.02 * np.random.default_rng(4).normal(size=TIME_S.size)
    drive = recorded(0.0)
    return replace(drive, signals={**drive.signals, "tilt": signal(TIME_S, read, "rad")})


def cubed(turned):
    """Over this input its slope is as good as that of degrees."""
    return turned + 25.0 * turned**3


def test_a_strong_effect_of_the_library_is_no_other_unit() -> None:
    drive = drive_of(cubed)
    [complaint] = failing_channels(Problem(spring(STIFFER), [drive]))
    assert "tilt in deg" in complaint.text
    assert blamed(spring(STIFFER), drive) == []
    with pytest.raises(Unusable, match="tilt in deg"):
        usable(spring(), [drive])


@pytest.mark.parametrize("zero_deg", [0.0, 20.0])
def test_another_unit_is_no_effect(zero_deg: float) -> None:
    """Nor where a bias beside the factor explains more than the factor alone: without it no effect explains anything."""
    with pytest.raises(Unusable, match="tilt in deg"):
        usable(spring(STIFFER), [drive_of(lambda turned: IN_DEGREES * turned + zero_deg)])
