"""`diagnose --apply` and `--with`: what was found goes into files that their readers take, and is then no longer missing."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.findings import Findings
from discrepancy.problem import Problem
from ecu.calibration import load_calibration
from hil.compose import Choice
from hil.diagnose.calibrated import RULES, calibrated
from hil.diagnose.extension import Applied
from hil.diagnose.machine_files import baseline, extended_files
from hil.diagnose.tomltext import Line, laid_over
from plant.effects import effects
from plant.equipment import load_equipment
from plant.machine import load_machine
from tests.discrepancy.toys import record
from tests.hil.diagnose.cases import Call, columns, finding, loaderhil, model_file, write_csv

__all__ = ["loaderhil"]


def test_what_was_applied_is_no_longer_missing(loaderhil: Call, tmp_path: Path) -> None:
    """A leak and a late gauge: found, applied, and the second diagnosis finds nothing on the same drive and on a new one."""
    model, extended = model_file(tmp_path), tmp_path / "tank.toml"
    file = write_csv(tmp_path / "drive.csv", columns(record(2, leak=0.08, delay_s=0.3)))
    first = loaderhil("diagnose", file, "--model", model, "--apply", extended)
    assert first.result is not None
    assert sorted(first.result.named) == ["leak", "level delay"]
    text = extended.read_text()
    assert "# found in drive.csv" in text.replace("#   ", "# ")
    held = tomllib.loads(text)["effects"]
    assert held["leak"]["leak"] == pytest.approx(0.08, rel=0.05)
    assert held["level delay"]["level.delay"] == pytest.approx(0.3, rel=0.05)
    other = write_csv(tmp_path / "other.csv", columns(record(9, leak=0.08, delay_s=0.3)))
    for drive in (file, other):
        again = loaderhil("diagnose", drive, "--model", model, "--with", extended)
        assert again.result is not None
        assert again.result.status == "nothing missing"


def test_a_second_application_keeps_the_first(loaderhil: Call, tmp_path: Path) -> None:
    model, one, two = model_file(tmp_path), tmp_path / "one.toml", tmp_path / "two.toml"
    leaky = write_csv(tmp_path / "leaky.csv", columns(record(2, leak=0.08)))
    late = write_csv(tmp_path / "late.csv", columns(record(3, leak=0.08, delay_s=0.3)))
    loaderhil("diagnose", leaky, "--model", model, "--apply", one)
    found = loaderhil("diagnose", late, "--model", model, "--with", one, "--apply", two)
    assert found.result is not None
    assert found.result.named == ["level delay"]
    before, after = (tomllib.loads(path.read_text())["effects"] for path in (one, two))
    assert after["leak"] == before["leak"]
    assert set(after) == {"leak", "level delay"}


def test_a_proxy_is_not_applied_but_said(loaderhil: Call, tmp_path: Path) -> None:
    odd = write_csv(tmp_path / "odd.csv", columns(record(5, square=0.02, noise=0.005)))
    model = model_file(tmp_path, "level scale", "level bias")
    ended = loaderhil("diagnose", odd, "--model", model, "--apply", tmp_path / "odd.toml")
    assert ended.result is not None
    assert ended.result.status == "unknown"
    assert "effects" not in tomllib.loads((tmp_path / "odd.toml").read_text())
    assert "not applied" in ended.out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("model = 'ball'", "not 'tank'"),
        ("model = 'tank'\n[effects.ghost]\na = 1", "no such effect; it has leak"),
        ("model = 'tank'\n[effects.leak]\nleak = 7", "is outside 0 to 1 1/s"),
        ("model = 'tank'\n[effects.leak]\nhole = 1", "effects.leak.hole is not a parameter"),
        ("model = 'tank'\n[effects.leak]", "effects.leak.leak = None is not a number"),
        ("model = tank", "not valid TOML"),
    ],
)
def test_a_baseline_that_cannot_be_is_refused_in_one_line(
    text: str, said: str, loaderhil: Call, tmp_path: Path
) -> None:
    file = write_csv(tmp_path / "drive.csv", columns(record(2)))
    (tmp_path / "with.toml").write_text(text)
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path), "--with", tmp_path / "with.toml")
    assert ended.code == 2
    last = ended.err.strip().splitlines()[-1]
    assert said in last
    assert "with.toml" in last


names = st.text("xyä.-_ =#[]\"'\\", min_size=1, max_size=8)
values = st.floats(allow_nan=False, allow_infinity=False)


@given(st.dictionaries(names, st.dictionaries(names, values, min_size=1, max_size=3), max_size=3))
def test_what_is_laid_over_reads_back_and_the_rest_stays(tables: dict[str, dict[str, float]]) -> None:
    base = "# head\nmodel = 'x'\n\n[first]  # a table\na = 1.0  # one\nb = 2.0\n\n# end of file\n"
    lines = [
        Line(("first", table), key, v, "told") for table, keys in tables.items() for key, v in keys.items()
    ]
    text = laid_over(base, [*lines, Line(("first",), "a", 3.0, "changed")])
    assert tomllib.loads(text) == {"model": "x", "first": {"a": 3.0, "b": 2.0, **tables}}
    assert "# head" in text
    assert "# end of file" in text


RESULT = Findings(
    model="loader",
    recordings=["gravel"],
    status="explained",
    reasons=[],
    findings=[
        finding("rolling_resistance", "physics", {"rolling_resistance.coefficient": 0.031, "rolling_resistance.growth_per_m_per_s": 0.02}),
        finding("payload_mass", "physics", {"payload_mass.extra_kg": 650.0}),
        finding("yaw_rate delay", "sensor", {"yaw_rate.delay": 0.06}),
        finding("pitch_rate bias", "sensor", {"pitch_rate.bias": 0.05}),
        finding("lift_pressure scale", "sensor", {"lift_pressure.scale": -0.04}),
        finding("washboard", "physics", {"washboard.height_mm": 5.0}, named=False),
    ],
)  # fmt: skip


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    out = tmp_path / "mine.toml"
    for file, text in extended_files(RESULT, None, out).files.items():
        file.write_text(text)
    return out


def test_the_loaders_files_hold_what_was_found(machine: Path) -> None:
    read, base = load_machine(machine), load_machine("l60")
    assert {item.effect.name: dict(item.named) for item in read.effects} == {
        "rolling_resistance": {"coefficient": 0.031, "growth_per_m_per_s": 0.02},
        "payload_mass": {"extra_kg": 650.0},
    }
    assert replace(read, effects=()) == base
    own, sheet = (load_equipment(x).sensors for x in (machine.with_name("mine.equipment.toml"), "l60"))
    assert own.of("yaw_rate").delay == pytest.approx(sheet.of("yaw_rate").delay + 0.06)
    assert own.of("pitch_rate").bias == pytest.approx(0.05)
    assert own.of("lift_pressure").scale_error == pytest.approx(-0.04)
    assert own.of("roll_rate") == sheet.of("roll_rate")
    calibration = load_calibration(machine.with_name("mine.calibration.toml"))
    assert calibration.parameters.wheel.rolling_resistance == 0.031
    assert "washboard is not applied" in machine.read_text()
    assert "payload_mass: the ECU weighs the payload" in machine.read_text()


def test_the_baseline_of_the_files_predicts_what_the_effects_do(machine: Path) -> None:
    """The model of the written files at its baseline is the plain model with the found values, to the bit."""
    from tests.discrepancy.test_loader import recorded

    drive = recorded(seconds=3.0)
    applied, plain = (
        Problem(baseline(machine, [drive]), [drive]),
        Problem(baseline(Path(__file__).parents[3] / "plant/machines/l60.toml", [drive]), [drive]),
    )
    found = {e.name: e.value for f in RESULT.findings if f.named for e in f.parameters}
    np.testing.assert_allclose(
        applied.predict(applied.start()), plain.predict(plain.start().with_shared(found)), rtol=1e-9
    )
    assert not np.allclose(applied.predict(applied.start()), plain.predict(plain.start()))


def test_a_sensor_that_would_know_the_future_is_not_applied(tmp_path: Path) -> None:
    result = replace(RESULT, findings=[finding("yaw_rate delay", "sensor", {"yaw_rate.delay": -0.02})])
    outcome = extended_files(result, None, tmp_path / "mine.toml")
    assert any("would know the future" in line for line in outcome.said)
    assert not any(file.name.endswith(".equipment.toml") for file in outcome.files)


def test_run_takes_what_lies_beside_the_machine(machine: Path) -> None:
    choice = Choice(scenario="standstill", changes=("surface.friction=0.5",)).on(str(machine))
    scenario = choice.load()
    assert scenario.machine == str(machine)
    assert scenario.equipment.sensors.of("pitch_rate").bias == pytest.approx(0.05)
    assert scenario.surface.friction == 0.5
    assert choice.calibration == str(machine.with_name("mine.calibration.toml"))
    assert Choice(scenario="standstill").on("compact").calibration is None, "that of the machine's family"


def typical(name: str) -> Applied:
    return Applied(name, "physics", {p.name: p.typical for p in effects()[name].parameters}, [])


def test_mass_moved_forward_is_conserved_and_so_is_its_moment() -> None:
    """The ECU's bodies weigh the same together; the front one's centre is that of its old mass and the moved one."""
    machine, moved = load_machine("l60"), 400.0
    numbers = {
        "front.mass_kg": 2442.0,
        "front.x_m": 1.314,
        "front.z_m": 0.865,
        "rear.mass_kg": 6018.0,
        "rear.z_m": 1.28,
    }
    new = {
        f"{line.table[0]}.{line.key}": line.value
        for line in calibrated([typical("mass_split")], numbers.__getitem__, machine).lines
    }
    assert new["front.mass_kg"] + new["rear.mass_kg"] == pytest.approx(2442.0 + 6018.0)
    assert new["front.mass_kg"] * new["front.x_m"] == pytest.approx(
        2442.0 * 1.314 + moved * machine.front_frame.x
    )


@pytest.mark.parametrize("name", RULES)
def test_every_rule_gives_a_calibration_that_loads(name: str, tmp_path: Path) -> None:
    result = replace(
        RESULT,
        findings=[finding(name, "physics", {f"{name}.{k}": v for k, v in typical(name).values.items()})],
    )
    outcome = extended_files(result, None, tmp_path / "mine.toml")
    for file, text in outcome.files.items():
        file.write_text(text)
    before, after = load_calibration("l60"), load_calibration(tmp_path / "mine.calibration.toml")
    assert before.parameters != after.parameters
    assert not any(name in line for line in outcome.said)
