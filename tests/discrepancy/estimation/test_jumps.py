"""Outputs that follow a command at once, read between grid points."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.estimation.jumps import Command, Commands
from discrepancy.estimation.problem import Problem
from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.model.sensors import misalignment, sensor_effects
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array, Recording, signal

STEP_S = 0.1
OHM, VOLT_PER_AS = 0.2, 0.01


def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
    current = window["current"]
    used = np.concatenate([[0.0], np.cumsum(current)[:-1]]) * window.step_s
    resistance = OHM * (1.0 + values.get("corrosion", 0.0))
    return {
        "voltage": values["rest"] - VOLT_PER_AS * used - resistance * current,
        "charge": values["start_charge"] - used,
    }


def cell() -> Model:
    """A cell whose voltage falls with the charge taken out, and at once with the current."""
    return Model(
        name="cell",
        sentence="a cell",
        inputs={"current": "A"},
        held=("current",),
        outputs={"voltage": "V", "charge": "A.s"},
        nuisances=(
            Parameter(
                name="rest",
                unit="V",
                typical=0.1,
                scope="window",
                guess=lambda w: w.at_start("voltage") + OHM * w["current"][0],
            ),
            Parameter(
                name="start_charge",
                unit="A.s",
                typical=1.0,
                scope="window",
                guess=lambda w: w.at_start("charge"),
            ),
        ),
        effects=(
            Effect(
                name="corrosion",
                sentence="the contacts corrode",
                equation="",
                parameters=(Parameter(name="corrosion", unit="1", lower=0.0, upper=5.0, typical=0.1),),
                kind="physics",
                place="contacts",
            ),
            *sensor_effects("voltage", "V", bias=0.1, kinds=("scale", "delay", "lag")),
        ),
        simulate=simulate,
        step_s=STEP_S,
        window_s=20.0,
    )


def record(
    seed: int, noise: float = 0.01, late_s: float = 0.0, corrosion: float = 0.0, apart_s: float = STEP_S
) -> Recording:
    """Commands every `apart_s`, readings 37 ms after each grid point; the truth is exact at its stamps."""
    rng = np.random.default_rng(seed)
    # whole milliseconds, at which everything is exact
    n = 80_000
    each = round(apart_s * 1000)
    current = np.repeat(rng.uniform(-5.0, 10.0, n // each + 1), each)[:n]
    used = np.concatenate([[0.0], np.cumsum(current)[:-1]]) * 1e-3
    voltage = 12.0 - VOLT_PER_AS * used - OHM * (1.0 + corrosion) * current
    at = np.arange(537, n, 100)
    seen = {"voltage": voltage[at - round(late_s * 1000)], "charge": 5.0 - used[at]}
    commands = np.arange(0, n, each)
    signals = {"current": signal(commands * 1e-3, current[commands], "A", held=True)}
    # the charge bends within a step where a command comes, which no grid shows: some 0.3 A s
    for name, unit, worse in (("voltage", "V", 1.0), ("charge", "A.s", 50.0)):
        signals[name] = signal(at * 1e-3, seen[name] + worse * noise * rng.normal(size=at.size), unit)
    return Recording("cell", signals)


def starting_right(problem: Problem) -> Array:
    """The prediction with the true initial states."""
    first = {
        "rest": [12.0 - VOLT_PER_AS * used(w) for w in problem.windows],
        "start_charge": [5.0 - used(w) for w in problem.windows],
    }
    return problem.predict(problem.start().starting_as({n: np.array(v) for n, v in first.items()}))


def used(window: Window) -> float:
    source = record(1, noise=0.0).signals["current"]
    until = source.time_s < window.time_s[0] - 1e-9
    return float(np.sum(source.value[until]) * (source.time_s[1] - source.time_s[0]))


def test_a_jump_is_read_as_one() -> None:
    """Of an exact recording nothing is left, between grid points as on them."""
    problem = Problem(cell(), [record(1, noise=0.0)])
    np.testing.assert_allclose(starting_right(problem), problem.measured, atol=1e-9)


@pytest.mark.parametrize("apart_s", [0.1, 0.13])
def test_no_delay_is_made_of_jumps(apart_s: float) -> None:
    """Commands with the grid and beside it."""
    results = [examine(cell(), [record(seed, apart_s=apart_s)], Settings()) for seed in range(3)]
    assert [r.status for r in results] == ["nothing missing"] * 3


def test_what_is_there_is_still_found() -> None:
    for truth, name, size in (
        ({"late_s": 0.05, "apart_s": 0.13}, "voltage delay", 0.05),
        ({"corrosion": 0.2}, "corrosion", 0.2),
    ):
        result = examine(cell(), [record(4, **truth)], Settings())
        assert result.named == [name]
        [found] = result.findings[0].parameters
        assert found.value == pytest.approx(size, rel=0.05)


def test_a_recording_without_the_command_is_read_too() -> None:
    """A second, optional current that only one of two recordings has, and that the voltage follows as the first."""

    def both(window: Window, values: Mapping[str, float], extra: Mapping[str, Array]) -> dict[str, Array]:
        total = window["current"] + (window["heater"] if window.has("heater") else 0.0)
        return simulate(replace(window, known={**window.known, "current": total}), values, extra)

    plain = replace(record(1, noise=0.0), name="plain")
    current = plain.signals["current"]
    on = replace(current, value=2.0 * (np.arange(current.value.size) % 3 == 0))
    heated = replace(record(1, noise=0.0), name="heated", signals={**plain.signals, "heater": on})
    model = replace(
        cell(), inputs={}, optional={"current": "A", "heater": "A"}, held=("heater",), simulate=both
    )
    without = Problem(model, [plain])
    together = Problem(model, [heated, plain])
    alone = np.isin(
        together.row_window, [i for i, w in enumerate(together.windows) if w.recording == "plain"]
    )
    np.testing.assert_allclose(
        together.predict(together.start())[alone], without.predict(without.start()), atol=1e-9
    )


def test_axes_that_may_be_turned_are_read_together() -> None:
    """A misalignment mixes two outputs, jumps and all."""
    turned = misalignment("voltage", "charge")
    model = replace(cell(), effects=(*cell().effects, turned))
    problem = Problem(model, [record(1, noise=0.0)])
    start = problem.start()
    straight, mixed = problem.predict(start), problem.predict(start.with_shared({turned.names[0]: 0.1}))
    volts, charge = (problem.row_channel == problem.channels.index(n) for n in ("voltage", "charge"))
    expected = np.cos(0.1) * straight[volts] + np.sin(0.1) * straight[charge]
    np.testing.assert_allclose(mixed[volts], expected, atol=1e-9)


def window_of(time_s: Array, **known: Array) -> Window:
    return Window(
        recording="r",
        start_s=float(time_s[0]),
        end_s=float(time_s[-1]),
        time_s=time_s,
        step_s=STEP_S,
        known=known,
        constants={},
    )


def test_squares_of_a_command_are_known() -> None:
    """Lift goes with the square of a speed of rotation."""
    time_s = STEP_S * np.arange(100)
    turns = np.random.default_rng(2).uniform(1.0, 3.0, 100)
    window = window_of(time_s, turns=turns)
    nothing = {"turns": np.zeros(100)}
    commands = Commands.of(window, {"turns": signal(time_s, turns, "rad/s", held=True)}, nothing)
    slow = np.sin(time_s / 10.0)
    smooth, gains = commands.split(0.7 * turns**2 + slow)
    np.testing.assert_allclose(gains[:2], [0.0, 0.7], atol=0.01)
    np.testing.assert_allclose(smooth, slow, atol=0.02)


def test_a_lag_behind_a_command_is_exact_at_any_time() -> None:
    rng = np.random.default_rng(3)
    stamps, values = np.sort(rng.uniform(0.0, 5.0, 20)), rng.normal(size=20)
    commands = Commands.made(np.zeros((3, 1)), [Command(stamps, values[:, None])])
    fine = np.arange(stamps[0], 5.0, 1e-4)
    held = values[np.searchsorted(stamps, fine, side="right") - 1]
    share = np.exp(-1e-4 / 0.2)
    slow = lfilter([0.0, 1.0 - share], [1.0, -share], held, zi=[held[0]])[0]
    np.testing.assert_allclose(commands.at(fine, 0.2)[:, 0], slow, atol=2e-3)
    # what is kept is of its delay and lag
    reading = commands.reading(fine[500:])
    for late_s, lag_s in [(0.0, 0.2), (0.05, 0.2), (0.05, 0.1), (0.0, 0.2), (0.0, 0.0)]:
        np.testing.assert_array_equal(reading(late_s, lag_s), commands.at(fine[500:] - late_s, lag_s))


def test_an_expensive_model_is_left_as_it_is() -> None:
    problem = Problem(replace(cell(), jacobian_reach=0.5), [record(1, noise=0.0)])
    assert np.max(np.abs(starting_right(problem) - problem.measured)) > 0.1


def test_a_window_keeps_only_what_it_may_see() -> None:
    """Of an hour of commands, each of hundreds of windows would keep all of them."""
    time_s = STEP_S * np.arange(36_000)
    source = signal(time_s, np.random.default_rng(2).normal(size=time_s.size), "A", held=True)
    grid = STEP_S * np.arange(20_000, 20_200)
    window = window_of(grid, current=source.value[20_000:20_200])
    commands = Commands.of(window, {"current": source}, {"current": np.zeros(200)})
    assert commands.recorded[0].stamps.size < 2_300
    # what it keeps is enough for a lag of 2 s
    late = commands.at(grid, lag_s=2.0)[:, 0]
    everything = Command(source.time_s, source.value[:, None])
    whole = Commands.made(np.zeros((3, 1)), [everything]).at(grid, lag_s=2.0)[:, 0]
    np.testing.assert_allclose(late, whole, atol=1e-12)
