"""Equations outside the library: a play of what is commanded, with the width that it has."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Parameter, Port, Window
from discrepancy.model.equations import READING
from discrepancy.selection import open_ended
from discrepancy.selection.assess import assess
from discrepancy.selection.feature_terms import Simulated, candidates
from discrepancy.selection.functions import functions, play
from discrepancy.selection.open_ended import explore, not_imitated
from discrepancy.selection.screen import Projector
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings, State
from discrepancy.signals.recording import Array, Recording, signal
from discrepancy.signals.units import parse_unit
from tests.discrepancy.toys import STEP_S, record, tank


def through_a_loose_valve(width: float, *, noise: float = 0.005) -> Recording:
    """A tank whose inflow follows its command with a play; the command wanders, the level is exact but for noise."""
    rng = np.random.default_rng(4)
    n = 1800
    command = 0.3 + 0.3 * np.convolve(rng.normal(size=n + 40), np.hanning(41) / 6.0, mode="valid")
    inflow, level, now = play(command, width), np.empty(n), 0.5
    a = np.exp(-0.2 * STEP_S)
    for i, u in enumerate(inflow.tolist()):
        level[i] = now
        now = a * now + (1.0 - a) / 0.2 * u
    time_s = STEP_S * np.arange(n)
    signals = {
        "inflow": signal(time_s, command, "m/s", held=True),
        "level": signal(time_s, level + noise * rng.normal(size=n), "m"),
    }
    return Recording("tank", signals)


@pytest.mark.parametrize("width", [0.03, 0.09])
def test_the_width_of_a_play_is_found_with_it(width: float) -> None:
    """dx/dt = play(u) / area, and nothing is known of the area: what the model has, dx/dt = u / area, gives way. Widths are begun at one."""
    model = tank("level bias")
    area, level = model.nuisances
    free = replace(area, upper=np.inf, prior_sd=None)
    problem = Problem(replace(model, nuisances=(free, level)), [through_a_loose_valve(width)])
    state, _ = search(problem, Settings())
    found = explore(problem, state, Settings())
    played = [t for t in found.terms if t.function.wide is not None]
    assert played
    assert played[0].reported.place == "inflow"
    assert played[0].function.wide is not None
    assert played[0].function.wide.width == pytest.approx(width, rel=0.05)


def behind_a_slow_valve(time_constant_s: float, *, noise: float = 0.002) -> Recording:
    """A tank whose inflow follows steps of its command with a first-order lag: dx/dt = lag(u) / area - 0.2 x."""
    rng = np.random.default_rng(7)
    n = 1800
    command = np.repeat(rng.uniform(0.0, 0.6, n // 30), 30)
    fine = 20  # Euler steps in one step of the recording: another method than the model's
    inflow, now, level = command[0], 0.5, np.empty(n)
    for i in range(n):
        level[i] = now
        for _ in range(fine):
            inflow += (command[i] - inflow) * STEP_S / fine / time_constant_s
            now += (inflow - 0.2 * now) * STEP_S / fine
    time_s = STEP_S * np.arange(n)
    signals = {
        "inflow": signal(time_s, command, "m/s", held=True),
        "level": signal(time_s, level + noise * rng.normal(size=n), "m"),
    }
    return Recording("tank", signals)


@pytest.mark.parametrize("time_constant_s", [0.3, 0.9])
def test_an_actuator_that_follows_its_command_late_is_said_with_its_time_constant(
    time_constant_s: float,
) -> None:
    problem = Problem(tank("level bias"), [behind_a_slow_valve(time_constant_s)])
    state, _ = search(problem, Settings())
    found = explore(problem, state, Settings())
    term = found.terms[0]
    assert term.reported.place == "inflow"
    assert term.function.text.startswith("(lowpass(inflow, ")
    assert term.function.wide is not None
    assert term.function.wide.width == pytest.approx(time_constant_s, rel=0.1)
    assert term.reported.coefficient == pytest.approx(1.0, abs=0.1)
    assert term.function.meaning.startswith("as if inflow acted late, behind a lag of 0.")


def test_a_late_brake_acts_against_the_sign_of_the_speed() -> None:
    """A step of the command lacks e^(-t/T) of itself, with the sign of the speed; afterwards nothing."""
    found = functions({"brake": "N", "speed": "m/s"}, {"brake": 100.0, "speed": 1.0}, {"brake"})
    late = next(f for f in found if f.text.endswith("- brake)·sign(speed)"))
    time_s = np.arange(0.0, 3.0, 0.01)
    command = np.where(time_s < 1.0, 0.0, 100.0)
    speed = np.where(time_s < 2.0, 1.0, -1.0)
    assert late.unit == parse_unit("N")
    assert late.wide is not None
    lacking = late.wide.having(0.25).of({"brake": command, "speed": speed}, 0.01)
    # the command may act from its stamp on or from the next one: half a step is the accuracy of the grid
    expected = np.where(time_s < 1.0, 0.0, -100.0 * np.exp(-(time_s - 1.0) / 0.25)) * np.sign(speed)
    np.testing.assert_allclose(lacking, expected, atol=100.0 * 0.01 / 0.25)
    np.testing.assert_allclose(lacking[time_s > 2.5], 0.0, atol=0.5)


def test_a_command_acts_through_its_play_times_another_signal_and_what_is_read_does_not() -> None:
    """Steering with play turns a car in proportion to its speed: a product with the units of both."""
    found = functions({"steering": "rad", "speed": "m/s"}, {"steering": 0.5, "speed": 1.0}, {"steering"})
    products = [f for f in found if f.text.startswith("play(") and f.text.endswith("·speed")]
    assert products
    assert not [f for f in found if f.text.startswith("play(speed") and "·" in f.text]
    steering, speed = np.array([0.0, 1.0, 0.5, -1.0]), np.array([1.0, 2.0, 3.0, 4.0])
    for f in products:
        assert f.unit == parse_unit("rad") * parse_unit("m/s")
        assert f.wide is not None
        w = f.wide.width
        expected = np.array([0.0, 1.0 - w, max(min(1.0 - w, 0.5 + w), 0.5 - w), -1.0 + w]) * speed
        np.testing.assert_allclose(f.of({"steering": steering, "speed": speed}, 0.01), expected)
        other = f.wide.having(0.2)
        assert replace(other, of=f.of, wide=None) == replace(f, text=other.text, wide=None)
        assert "0.2 rad" in other.text


def test_what_a_nuisance_does_is_no_function_beside_it() -> None:
    """The area scales the inflow: of the same term at the port only the difference of the steps is left."""
    problem = Problem(tank("leak"), [record(1, leak=0.1)])
    state, _ = search(problem, Settings())
    projector = Projector(problem, state.noise, state.fit)
    for made in candidates(problem, state, Simulated(problem, state)):
        if made.place == "inflow" and made.function.text in ("inflow", "level", "1"):
            white = state.noise.whiten(made.raw)[:, None]
            [seen] = not_imitated(white, projector.off(white))
            assert seen == (made.function.text == "1")


def two_tanks(seed: int = 3, size: float = 0.01) -> Recording:
    """A tank that also loses water to another one through a hole, by the square of the difference of their levels."""
    rng = np.random.default_rng(seed)
    n, fine = 1800, 10
    inflow = np.repeat(rng.uniform(0.0, 1.0, n // 30), 30)
    other = 1.5 + 1.2 * np.sin(np.arange(n) / 130.0)
    level, now = np.empty(n), 0.5
    for i in range(n):
        level[i] = now
        for _ in range(fine):
            higher = other[i] - now
            now += STEP_S / fine * (inflow[i] - 0.2 * now + size * higher * abs(higher))
    time_s = STEP_S * np.arange(n)
    signals = {
        "inflow": signal(time_s, inflow, "m/s", held=True),
        "other": signal(time_s, other, "m"),
        "level": signal(time_s, level + 0.005 * rng.normal(size=n), "m"),
    }
    return Recording("tanks", signals)


def beside_another() -> Model:
    """The tank alone, in a model that knows the level of the other one."""
    plain = tank("level bias")
    return replace(plain, inputs={**plain.inputs, "other": "m"})


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_law_of_a_difference_is_found(seed: int) -> None:
    """To first order: the term is of levels without it, of which the area has taken a part; at this size some tenth is missing."""
    problem = Problem(beside_another(), [two_tanks(seed)])
    state, _ = search(problem, replace(Settings(), most_effects=0))
    found = explore(problem, state, Settings())
    [term] = [t.reported for t in found.terms]
    assert (term.place, term.function) == ("inflow", "(other - level)·|other - level|")
    assert term.coefficient == pytest.approx(0.01, rel=0.15)
    assert not found.unconfirmed


def test_where_held_out_data_refuse_one_function_the_next_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Functions of the same likelihood are asked in turn; if all are refused, that one had the evidence is known."""
    problem = Problem(beside_another(), [two_tanks()])
    state, _ = search(problem, replace(Settings(), most_effects=0))
    asked = list[int]()

    def refuse(first: int, plain: object = open_ended._held_out) -> None:
        def held_out(problem: Problem, state: State, white: Array, settings: Settings) -> Array:
            asked.append(white.shape[1])
            reduction: Array = plain(problem, state, white, settings)  # type: ignore[operator]
            return 0.0 * reduction if len(asked) <= first else reduction

        monkeypatch.setattr(open_ended, "_held_out", held_out)

    alike = replace(Settings(), same=1e9)
    refuse(1)
    assert explore(problem, state, alike).terms
    refuse(10**6)
    none = explore(problem, state, alike)
    assert not none.terms
    assert none.unconfirmed


def spinning(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
    """dv/dt = thrust - 0.3 v, exact for what is held; the wheel is faster by what the thrust makes it slip."""
    thrust = window["thrust"] + extra.get("thrust", 0.0)
    kept = np.exp(-0.3 * window.step_s)
    speed = lfilter([0.0, (1.0 - kept) / 0.3], [1.0, -kept], thrust, zi=[values["speed"]])[0]
    return {"wheel": speed + values.get("slip", 0.0) * thrust, "gps": speed}


def test_what_is_there_through_an_effect_alone_does_not_stand_beside_it() -> None:
    """The wheel's speed less that of the satellites is the slip, which is accepted."""
    known = {"thrust": "m/s^2"}
    slip = Effect(name="slip", sentence="", equation="", kind="physics", place="wheel",
                  parameters=(Parameter(name="slip", unit="s", lower=0.0, upper=1.0, typical=0.02),))  # fmt: skip
    start = Parameter(
        name="speed", unit="m/s", typical=0.1, scope="window", guess=lambda w: w.at_start("gps")
    )
    model = Model(name="spin", sentence="", inputs=known, held=("thrust",), outputs={"wheel": "m/s", "gps": "m/s"},
                  nuisances=(start,), effects=(slip,), simulate=spinning, step_s=0.1, window_s=20.0,
                  ports=(Port(name="thrust", unit="m/s^2", typical=0.1, sentence=""),))  # fmt: skip
    rng, time_s = np.random.default_rng(1), 0.1 * np.arange(1200)
    thrust = np.repeat(rng.uniform(-1.0, 1.0, 60), 20)
    window = Window(
        recording="r",
        start_s=0.0,
        end_s=119.9,
        time_s=time_s,
        step_s=0.1,
        known={"thrust": thrust},
        constants={},
    )
    true = spinning(window, {"speed": 0.0, "slip": 0.05}, {})
    seen = {
        name: signal(time_s, values + 0.01 * rng.normal(size=1200), "m/s") for name, values in true.items()
    }
    recording = Recording("r", {"thrust": signal(time_s, thrust, "m/s^2", held=True), **seen})
    problem = Problem(model, [recording])
    state = assess(problem, ("slip",), problem.start(), Settings())
    simulated = Simulated(problem, state)
    every = functions(simulated.units, simulated.spread, {"thrust"})
    [apart] = [f for f in every if f.text == "(wheel - gps)"]
    assert simulated.shape(apart) is not None
    made = [c.function.text for c in candidates(problem, state, simulated) if c.place == READING + "wheel"]
    assert "gps" in made
    assert not any(apart.text in text for text in made)
