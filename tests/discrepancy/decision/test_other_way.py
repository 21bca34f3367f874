"""A drive with a lag in its library, whose two readings both come late: the lag alone explains most of it, the two delays all."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discrepancy.decision.again.other_way import OtherWay, doubted, other_ways
from discrepancy.decision.judge import judge
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model, Parameter
from discrepancy.model.sensors import sensor_effects
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording, signal
from tests.discrepancy.toys import physics

STEP_S, SLOWS_S = 0.05, 2.0
NOISE = {"speed": 0.005, "position": 0.01}
DELAY_S = 0.17


def lagged(u, lag_s, step_s, start):
    if lag_s <= 1e-6:
        return u
    a = np.exp(-step_s / lag_s)
    return lfilter([0.0, 1.0 - a], [1.0, -a], u, zi=[start])[0]


def moved(command, step_s, speed, position, lag_s=0.0, slows_s=SLOWS_S):
    """Speed that follows a command by a lag of first order, and the way."""
    v = lagged(lagged(command, lag_s, step_s, command[0]), slows_s, step_s, speed)
    return v, position + step_s * np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2.0)])


def simulate(window, values, extra):
    command = window["command"] + extra.get("command", 0.0)
    start = values["speed at start"], values["position at start"]
    v, x = moved(command, window.step_s, *start, values.get("motor lag", 0.0), values["slows"])
    return {"speed": v, "position": x}


def drive(*effects):
    library = (
        physics("motor lag", Parameter(name="motor lag", unit="s", lower=0.0, upper=1.0, typical=0.05)),
        *sensor_effects("speed", "m/s", bias=0.1, kinds=("delay", "scale")),
        *sensor_effects("position", "m", bias=0.1, kinds=("delay", "scale")),
    )
    return Model(
        name="drive",
        sentence="a drive that follows its command",
        inputs={"command": "m/s"},
        held=("command",),
        outputs={"speed": "m/s", "position": "m"},
        nuisances=(
            Parameter(name="slows", unit="s", value=SLOWS_S, lower=0.5, upper=8.0, typical=0.05, prior_sd=0.05),
            *(
                Parameter(name=f"{c} at start", unit=u, typical=0.1, scope="window", guess=lambda w, c=c: w.at_start(c))
                for c, u in (("speed", "m/s"), ("position", "m"))
            ),
        ),
        effects=tuple(e for e in library if not effects or e.name in effects),
        simulate=simulate,
        step_s=STEP_S,
        window_s=20.0,
        sensor_noise=NOISE,
    )  # fmt: skip


def record(seed, *, lag_s=0.0, delay_s=0.0, duration_s=100.0):
    """Truth at a twentieth of the model's step."""
    rng, fine = np.random.default_rng(seed), 20
    n = int(duration_s / STEP_S)
    command = np.repeat(np.repeat(rng.uniform(-1.0, 1.5, n // 40 + 1), 40)[:n], fine)
    readings = dict(zip(NOISE, moved(command, STEP_S / fine, 0.0, 0.0, lag_s), strict=True))
    time_s = STEP_S / fine * np.arange(n * fine)
    signals = {"command": signal(time_s[::fine], command[::fine], "m/s", held=True)}
    for (name, values), unit in zip(readings.items(), ("m/s", "m"), strict=True):
        late = np.interp(time_s - delay_s, time_s, values)[::fine]
        signals[name] = signal(time_s[::fine], late + rng.normal(0.0, NOISE[name], n), unit)
    return Recording("drive", signals)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_delays_explain_more_than_the_lag_that_was_taken_first(seed):
    problem = Problem(drive(), [record(seed, delay_s=DELAY_S)])
    state, _ = search(problem, Settings(most_effects=1))
    assert state.accepted == ("motor lag",)  # the best single effect
    (way,) = other_ways(problem, state, state.accepted, Settings())
    assert way.barred == "motor lag"
    assert set(way.state.accepted) == set(way.instead) == {"speed delay", "position delay"}
    assert way.clearly_better


def test_the_verdict_is_theirs():
    """A seed in which the search keeps the lag beside a delay; in five others a delay makes it needless by itself."""
    problem = Problem(drive(), [record(2, delay_s=DELAY_S)])
    found = judge(problem, Settings()).findings
    assert found.status == "explained", found.reasons
    assert set(found.named) == {"speed delay", "position delay"}
    for each in found.findings:
        (delay,) = each.parameters
        assert delay.low < DELAY_S < delay.high
    assert found.reasons[0].startswith("with them, no other effect")
    assert any("all readings come late by 0.17 s: command acting late by that" in r for r in found.reasons)
    # what was barred is in the library again for the verdict
    assert {c.effect for c in found.candidates} == {e.name for e in drive().effects}


@pytest.mark.parametrize("seed", [1, 2])
def test_a_lag_that_is_one_stays(seed):
    problem = Problem(drive(), [record(seed, lag_s=DELAY_S)])
    state, _ = search(problem, Settings())
    assert "motor lag" in state.accepted
    assert not list(other_ways(problem, state, ["motor lag"], Settings()))


def test_without_another_effect_there_is_no_other_way():
    problem = Problem(drive("motor lag"), [record(1, delay_s=DELAY_S)])
    found = judge(problem, Settings()).findings
    assert found.status != "explained"
    assert [x.effect for x in found.findings] == ["motor lag"]


@pytest.mark.parametrize(("sd", "kept"), [(20.0, []), (80.0, ["motor lag"])])
def test_what_others_explain_better_without_is_a_proxy(sd, kept):
    """By evidence 100: five standard deviations, or one and a quarter."""
    problem = Problem(drive(), [record(1, lag_s=DELAY_S)])
    first = judge(problem, Settings())
    assert first.findings.named == ["motor lag"]
    way = OtherWay("motor lag", first.state, ("speed delay", "position delay"), 100.0, sd)
    ways = [w for w in (way,) if w.clearly_better]
    found = doubted(first, ways).findings
    assert found.named == kept
    assert (found.status == "unknown") is (kept == [])
    said = "motor lag is only the best proxy, the cause is unknown: without it, speed delay and position delay explain the recordings better, by evidence 100"
    assert (said in found.reasons) is (kept == [])
