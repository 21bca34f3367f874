"""`loaderhil effects add`: an equation found outside the library becomes an effect that the next diagnosis, or the plant, knows."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnosis.apply.functions import read_function
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Parameter
from discrepancy.model.equations import with_effect
from discrepancy.selection.functions import functions
from discrepancy.signals.findings import Findings, OpenEquation, OpenTerm, to_json
from discrepancy.signals.recording import Array
from loaderhil import cli
from plant.effects import ActiveEffect
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, tank
from tests.plant.effects.test_library import own_effect, run_python

__all__ = ["loaderhil"]
L60 = load_machine("l60")


def call(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["loaderhil", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return int(ended.value.code or 0)


def test_what_was_unknown_has_a_name_after_one_command(
    loaderhil: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drain that grows with the square of the level, which the library does not hold: found as an equation, added, then named."""
    odd = write_csv(tmp_path / "odd.csv", columns(record(5, square=0.02, noise=0.005)))
    model, own = model_file(tmp_path, "level scale", "level bias"), tmp_path / "own" / "drain.py"
    first = loaderhil("diagnose", odd, "--model", model, folder=tmp_path / "first")
    assert first.result is not None
    assert first.result.status == "unknown"
    assert first.result.open_ended is not None
    [term] = first.result.open_ended.terms
    words = ("effects", "add", tmp_path / "first", "--name", "steep drain", "--model", model, "--out", own)
    assert call(monkeypatch, *words) == 0
    other = write_csv(tmp_path / "other.csv", columns(record(8, square=0.02, noise=0.005)))
    again = loaderhil("diagnose", other, "--model", own, "--apply", tmp_path / "drain.toml")
    assert again.result is not None
    assert again.result.named == ["steep drain"]
    estimate = again.result.findings[0].parameters[0]
    assert estimate.unit == term.unit
    # the equation was found in outputs without it, the effect acts on those with it
    assert abs(estimate.value + 0.02) < 0.1 * 0.02 < abs(term.coefficient + 0.02)
    last = loaderhil("diagnose", odd, "--model", own, "--with", tmp_path / "drain.toml")
    assert last.result is not None
    assert last.result.status == "nothing missing"


TIME = 0.01 * np.arange(2000)
SIGNALS = {"a": np.sin(TIME), "b": np.cos(3.0 * TIME) + 0.5, "c": np.sin(2.0 * TIME) - 0.3}
UNITS = {"a": "m", "b": "s", "c": "m"}  # two of one quantity, whose difference counts


@pytest.mark.parametrize("text", [f.text for f in functions(UNITS, dict.fromkeys(UNITS, 0.7), {"a"})])
def test_every_function_of_the_search_becomes_code(text: str) -> None:
    """The written code gives what the search used, but for the digits of a width in its text."""
    from discrepancy.model.operators import play
    from discrepancy.model.sensors import lagged

    # a sign's width is the signal's own spread; that of a play stands in its text
    spread = {n: float(np.std(v)) if "sign" in text else 0.7 for n, v in SIGNALS.items()}
    found = {f.text: f for f in functions(UNITS, spread, {"a"})}
    searched = found[text].of(SIGNALS, 0.01)
    read = read_function(text)
    names: dict[str, object] = {"np": np, "s": SIGNALS, "step": 0.01, "play": play, "lagged": lagged}
    code: Array = eval(read.arrays, names)
    np.testing.assert_allclose(code, searched, rtol=1e-9, atol=1e-9)
    if read.numbers:
        once = eval(read.numbers, {n: float(SIGNALS[n][700]) for n in read.signals})
        assert once == pytest.approx(float(searched[700]))


def test_a_term_acts_at_its_place_and_is_off_at_zero() -> None:
    effect = Effect(
        name="more", sentence="", equation="", kind="physics", place="", parameters=(Parameter(name="more.c1", unit="1"),)
    )  # fmt: skip
    drive = record(1)
    plain, at_port, at_reading = (
        Problem(m, [drive])
        for m in (
            tank(),
            with_effect(tank(), effect, {"inflow": lambda s, v, _: v["more.c1"] * s["inflow"]}),
            with_effect(tank(), effect, {"reading of level": lambda s, v, _: v["more.c1"] * s["level"]}),
        )
    )
    base = plain.predict(plain.start())
    for problem in (at_port, at_reading):
        np.testing.assert_array_equal(problem.predict(problem.start()), base)
    # half as much inflow again is what an area of 1 / 1.5 makes of it
    np.testing.assert_allclose(
        at_port.predict(at_port.start().having(**{"more.c1": 0.5})),
        plain.predict(plain.start().having(area=1.0 / 1.5)),
        rtol=1e-9,
    )
    np.testing.assert_allclose(at_reading.predict(at_reading.start().having(**{"more.c1": 0.5})), 1.5 * base)
    with pytest.raises(ValueError, match="no place 'ghost'"):
        with_effect(tank(), effect, {"ghost": lambda s, v, _: s["level"]})


def test_a_term_of_the_level_is_the_leak_that_it_stands_for() -> None:
    """-c level at the inflow against the parameter `leak` = c, which the tank integrates exactly: the term acts on the level that it lowers."""
    effect = Effect(
        name="more", sentence="", equation="", kind="physics", place="", parameters=(Parameter(name="more.c1", unit="1/s"),)
    )  # fmt: skip
    drive = [record(1)]
    plain = Problem(tank("leak"), drive)
    added = Problem(
        with_effect(tank("leak"), effect, {"inflow": lambda s, v, _: -v["more.c1"] * s["level"]}), drive
    )
    tight, leaking = plain.predict(plain.start()), plain.predict(plain.start().having(leak=0.05))
    found = added.predict(added.start().having(**{"more.c1": 0.05}))
    assert np.linalg.norm(found - leaking) < 0.01 * np.linalg.norm(leaking - tight)


def term(place: str, function: str, coefficient: float = 2.0) -> OpenTerm:
    return OpenTerm(
        place=place,
        function=function,
        coefficient=coefficient,
        low=1.0,
        high=3.0,
        unit="1/s",
        equally_good=[],
    )


def equation(model: str, *terms: OpenTerm) -> Findings:
    found = OpenEquation(
        equation="x",
        depends_on=["yaw_rate"],
        terms=list(terms),
        sse_reduction=1.0,
        threshold=1.0,
        held_out_sse_reduction=1.0,
    )
    return Findings(model=model, recordings=["r"], status="unknown", reasons=[], open_ended=found)


PUSHED = equation(
    "loader",
    term("reading of specific_force_x", "articulation_rate·|articulation_rate|", 1.5),
    term("reading of specific_force_y", "yaw_rate·articulation_angle", -0.8),
)
MOTIONS = """
import json
from tests.diagnosis.apply.test_effect_file import moving
from discrepancy.models.loader.library import library
from plant.effects import find_effect

assert {"crab", "headwind"} <= {e.name for e in library()}
crab = moving(find_effect("crab").typical(), turning=True)
sideways = [moving(find_effect("crab").of(c1=1.5, c2=c2), turning=True, seconds=0.01) for c2 in (-0.8, 0.0)]
wind = [moving(find_effect("headwind").of(force_N=1000.0, height_m=0.0), seconds=s) for s in (1.0, 3.0)]
print(json.dumps([crab, sideways, wind]))
"""
FORCES = """
import json
import numpy as np
from plant.effects import dispatch, find_effect
from plant.physics.parameters import parameter_vector
from plant.physics.state import STATES
from plant.physics.surface import Surface
from plant.physics.workspace import new_workspace
from plant.sheets.machine import load_machine

def force(*chosen):
    work = new_workspace()
    work.whole[:] = 12e3, 0.9, 0.1, 1.2
    p = parameter_vector(load_machine("l60"), Surface(), 0.0)
    dispatch.bodies(dispatch.active_vector(chosen), np.linspace(0.1, 1.0, STATES), p, work)
    return work.tree.bias.tolist()

print(json.dumps([force(find_effect(name).typical()) for name in ("crab", "headwind")]))
"""


def moving(*chosen: ActiveEffect, turning: bool = False, seconds: float = 0.2) -> dict[str, float]:
    """What the machine does after so long with these effects, from 3 m/s; turning: while its joint is turned."""
    plant = Plant(replace(L60, effects=chosen), speed=3.0, articulation_angle=0.3 if turning else 0.0)
    plant.advance(Commands(articulation_rate=0.4 if turning else 0.0), seconds)
    now = plant.truth()
    return {
        "speed": float(now.speed),
        "ahead": float(now.velocity[0]),
        "left": float(now.velocity[1]),
        "rate": float(now.articulation_rate),
        "yaw_rate": float(now.angular_velocity[2]),
        "angle": float(now.articulation_angle),
    }


@pytest.fixture(scope="module")
def own_effects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two effects: that of `effects add` and that of the how-to."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "findings.json").write_text(to_json(PUSHED))
    own = folder / "effects"
    with pytest.MonkeyPatch.context() as patch:
        assert call(patch, "effects", "add", folder, "--name", "crab", "--out", own / "crab.py") == 0
    (own / "headwind.py").write_text(own_effect(), encoding="utf-8")
    return own


def printed_with(own_effects: Path, code: str, **environment: str) -> list[Any]:
    ran = run_python(code, own_effects, **environment)
    assert ran.returncode == 0, ran.stderr
    printed: list[Any] = json.loads(ran.stdout)
    return printed


@pytest.fixture(scope="module")
def motions(own_effects: Path) -> list[Any]:
    """In Python: to compile a plant that has these effects takes minutes."""
    return printed_with(own_effects, MOTIONS, NUMBA_DISABLE_JIT="1")


def test_the_plants_effect_is_known_to_effects_machine_files_and_the_diagnosis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "findings.json").write_text(to_json(PUSHED))
    own = tmp_path / "effects" / "crab.py"
    assert call(monkeypatch, "effects", "add", tmp_path, "--name", "crab", "--out", own) == 0
    assert "LOADERHIL_EFFECTS" in capsys.readouterr().out
    printed = subprocess.run(
        [sys.executable, "-m", "loaderhil", "effects", "crab"],
        capture_output=True,
        text=True,
        env={**os.environ, "LOADERHIL_EFFECTS": str(own.parent)},
        check=True,
    )
    assert "a_x += c1 articulation_rate·|articulation_rate|" in printed.stdout
    assert "c2 = -0.8" in printed.stdout


@pytest.mark.slow
def test_the_plants_effect_pushes_as_the_equation_says(motions: list[Any]) -> None:
    """Articulating at 0.4 rad/s for 0.2 s it gains speed ahead, within a half of c1 r |r| dt (the servo needs its time, the tyres hold against it)."""
    (crab, (with_term, without), _), plain = motions, moving(turning=True)
    square = crab["rate"] * abs(crab["rate"])
    assert 0.2 * 1.5 * square * 0.2 < crab["ahead"] - plain["ahead"] < 1.5 * square * 0.2
    # Both runs share the push ahead, which changes the lateral speed too, and end before the tyres turn the frame about its axle.
    sideways = -0.8 * with_term["yaw_rate"] * with_term["angle"]
    assert (with_term["left"] - without["left"]) * sideways > 0.0


@pytest.mark.slow
def test_the_effect_of_the_how_to_works(motions: list[Any]) -> None:
    """Its force over the mass, less what turns with the wheels, is the deceleration."""
    first, second = motions[2]
    mass = L60.mass + 4 * L60.wheel.spin_inertia / 0.73**2
    assert (first["speed"] - second["speed"]) / 2.0 == pytest.approx(1000.0 / mass, rel=5e-3)


@pytest.mark.slow
def test_the_machine_code_that_calls_added_effects_pushes_as_python_does(own_effects: Path) -> None:
    """The generated callers with the library and both files, without the rest of the plant."""
    machine_code, python = (printed_with(own_effects, FORCES, NUMBA_DISABLE_JIT=off) for off in ("0", "1"))
    for compiled, plain in zip(machine_code, python, strict=True):
        assert np.any(plain)
        # one multiplication and addition may be rounded once in place of twice
        np.testing.assert_allclose(compiled, plain, rtol=1e-12)


@pytest.mark.parametrize(
    ("result", "words", "said"),
    [
        (replace(PUSHED, open_ended=None), ("--name", "x"), "has no open-ended equation beside the library"),
        (PUSHED, ("--name", 'a"b'), "must be of letters, digits, spaces"),
        (PUSHED, ("--name", "two words"), "may have only letters, digits and _, such as two_words"),
        (equation("tank", term("inflow", "level")), ("--name", "x"), "name its file by --model FILE.py"),
        (
            equation("straight", term("force", "sinh(speed)")),
            ("--name", "x"),
            "cannot be written as code",
        ),
    ],
)
def test_what_cannot_become_an_effect_is_one_line(
    result: Findings,
    words: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "findings.json").write_text(to_json(result))
    assert call(monkeypatch, "effects", "add", tmp_path, *words, "--out", tmp_path / "x.py") == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert not (tmp_path / "x.py").exists()


def test_a_loader_reading_stays_an_effect_of_the_diagnosis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The plant has no place for it; the file is then a model."""
    from diagnosis.models import find_model

    (tmp_path / "findings.json").write_text(
        to_json(equation("loader", term("reading of lift_pressure", "lift_arm_angle²")))
    )
    own = tmp_path / "odd.py"
    assert call(monkeypatch, "effects", "add", tmp_path, "--name", "odd gauge", "--out", own) == 0
    assert "diagnose RECORDING --model" in capsys.readouterr().out
    model = find_model(str(own)).build(())
    assert model.name == "loader"
    assert model.effects[-1].name == "odd gauge"
    assert model.effects[-1].kind == "sensor"
