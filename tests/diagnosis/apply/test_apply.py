"""`diagnose --apply` and `--with`: what was found goes into files that their readers take, and is then no longer missing."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.apply.calibration import RULES, calibrated
from diagnosis.apply.extension import Applied, BadExtension
from diagnosis.apply.machine_files import baseline, extended_files
from diagnosis.apply.toml_text import Line, with_values
from discrepancy.estimation.problem import Problem
from discrepancy.signals.findings import Findings
from ecu.calibration import CALIBRATIONS, load_calibration
from hil.companions import CALIBRATION, EQUIPMENT, named
from hil.compose import Choice
from plant.effects import effects
from plant.sheets.machine import load_machine
from plant.unit.equipment import load_equipment
from plant.unit.signals import CHANNELS
from tests.diagnosis.cases import Call, columns, finding, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record

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


def test_what_is_to_be_applied_is_written_though_the_reader_of_the_words_has_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `diagnose ... --apply FILE | head -3`."""
    from diagnosis.command import diagnose

    def left(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("diagnosis.terminal.render", left)
    file, mine = write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08))), tmp_path / "mine.toml"
    with pytest.raises(BrokenPipeError):
        diagnose([file], model=str(model_file(tmp_path)), apply=mine)
    assert "leak = 0.08" in mine.read_text()


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


def test_more_of_the_same_is_found_beside_what_was_applied(loaderhil: Call, tmp_path: Path) -> None:
    """The leak and the gauge's delay grow: the second diagnosis states their present and their earlier values; then nothing is missing."""
    model, file = model_file(tmp_path), tmp_path / "tank.toml"
    for seed, leak, delay in ((2, 0.06, 0.2), (3, 0.12, 0.4)):
        drive = write_csv(tmp_path / f"{seed}.csv", columns(record(seed, leak=leak, delay_s=delay)))
        before = tomllib.loads(file.read_text())["effects"] if file.exists() else {}
        found = loaderhil(
            "diagnose", drive, "--model", model, "--apply", file, *(("--with", file) if before else ())
        )
        assert found.result is not None
        assert sorted(found.result.named) == ["leak", "level delay"]
        for item in found.result.findings:
            (size,) = item.parameters
            assert size.baseline == (before[item.effect][size.name] if before else 0.0)
        held = tomllib.loads(file.read_text())["effects"]
        assert held["leak"]["leak"] == pytest.approx(leak, rel=0.05)
        assert held["level delay"]["level.delay"] == pytest.approx(delay, rel=0.05)
    assert f"; was {before['leak']['leak']:.4g}" in file.read_text()
    assert f"baseline {before['leak']['leak']:.4g}" in found.out
    assert file.read_text().count("# Effects found by `loaderhil diagnose`") == 1
    again = loaderhil("diagnose", drive, "--model", model, "--with", file)
    assert again.result is not None
    assert again.result.status == "nothing missing"


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
        (
            f"model = 'tank'\n[effects.leak]\nleak = 1{'0' * 400}",
            "effects.leak.leak has more digits than a number of 1/s",
        ),
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
def test_written_values_read_back_and_other_values_stay(tables: dict[str, dict[str, float]]) -> None:
    base = "# head\nmodel = 'x'\n\n[first]  # a table\na = 1.0  # one\nb = 2.0\n\n# end of file\n"
    lines = [
        Line(("first", table), key, v, "test") for table, keys in tables.items() for key, v in keys.items()
    ]
    text = with_values(base, [*lines, Line(("first",), "a", 3.0, "changed")])
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
    assert "need not follow payload_mass: the ECU measures the payload" in machine.read_text()
    assert "does not follow yaw_rate delay" in machine.read_text()


@pytest.mark.slow
def test_the_baseline_of_the_files_predicts_what_the_effects_do(machine: Path) -> None:
    """The model of the written files at its baseline is the plain model with the found values, to the bit."""
    from tests.discrepancy.models.loader.test_loader import recorded

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
    assert any("would be negative" in line for line in outcome.messages)
    assert not any(file.name.endswith(".equipment.toml") for file in outcome.files)


def applied_in_steps(folder: Path, *steps: Findings) -> Path:
    """The machine file after one application upon the other, each beside its own equipment and calibration."""
    base: Path | None = None
    for number, result in enumerate(steps):
        out = folder / f"step{number}.toml"
        for file, text in extended_files(result, base, out).files.items():
            file.write_text(text)
        base = out
    assert base is not None
    return base


MORE = {
    "rolling_resistance": {"rolling_resistance.coefficient": 0.05},
    "mass_split": {"mass_split.forward_kg": 300.0},
    "vertical_damping": {"vertical_damping.damping": 0.8, "vertical_damping.stiffness": 1.1},
    "yaw_rate delay": {"yaw_rate.delay": 0.09},
    "pitch_rate bias": {"pitch_rate.bias": 0.08},
    "lift_pressure scale": {"lift_pressure.scale": 0.03},
}


def found(values: Mapping[str, Mapping[str, float]]) -> Findings:
    sensors = [name for name in values if " " in name]
    return replace(
        RESULT,
        findings=[
            finding(name, "sensor" if name in sensors else "physics", size) for name, size in values.items()
        ],
    )


def halved(values: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    return {name: {key: 0.5 * v for key, v in size.items()} for name, size in values.items()}


def test_two_steps_lead_to_the_same_machine_as_one(tmp_path: Path) -> None:
    """What a second diagnosis finds of an effect is all of it: nothing is counted twice, in sensors and the ECU's calibration neither."""
    (tmp_path / "once").mkdir()
    twice = applied_in_steps(tmp_path, found(halved(MORE)), found(MORE))
    once = applied_in_steps(tmp_path / "once", found(MORE))
    assert load_machine(twice) == load_machine(once)
    sensors = [load_equipment(named(file, EQUIPMENT)).sensors for file in (twice, once)]
    for channel in CHANNELS:
        assert astuple(sensors[0].of(channel)) == pytest.approx(astuple(sensors[1].of(channel)))
    assert calibration_of(twice) == pytest.approx(calibration_of(once))
    assert calibration_of(once) != pytest.approx(numbers_of(CALIBRATIONS / "l60.toml"))


def calibration_of(machine: Path) -> dict[str, float]:
    return numbers_of(named(machine, CALIBRATION))


def numbers_of(file: Path) -> dict[str, float]:
    """Every number of a calibration by 'table.key'."""
    tables = tomllib.loads(file.read_text())
    return {
        f"{table}.{key}": value
        for table, entries in tables.items()
        if isinstance(entries, dict)
        for key, value in entries.items()
        if not isinstance(value, str)
    }


def test_effects_of_a_machine_without_its_own_calibration_are_followed_too(tmp_path: Path) -> None:
    """A machine file written by hand has none; the family's knows nothing of its effects."""
    by_hand = tmp_path / "hand.toml"
    by_hand.write_text('base = "l60"\nname = "mine"\n[effects.tyre_wear]\nfront_mm = 30.0\nrear_mm = 20.0\n')
    files = extended_files(
        found({"wheel_spin_inertia": {"wheel_spin_inertia.extra_kg_m2": 20.0}}),
        by_hand,
        tmp_path / "out.toml",
    ).files
    for file, text in files.items():
        file.write_text(text)
    old, new = numbers_of(CALIBRATIONS / "l60.toml"), calibration_of(tmp_path / "out.toml")
    assert new["wheel.unloaded_radius_m"] == pytest.approx(old["wheel.unloaded_radius_m"] - 0.025)
    assert new["wheel.spin_inertia_kg_m2"] == pytest.approx(old["wheel.spin_inertia_kg_m2"] + 20.0)


def test_a_machine_of_another_family_keeps_its_own_calibration(tmp_path: Path) -> None:
    result = found({"yaw_rate scale": {"yaw_rate.scale": 0.03}})
    files = extended_files(result, Path("compact"), tmp_path / "out.toml").files
    calibration, equipment = (files[named(tmp_path / "out.toml", kind)] for kind in (CALIBRATION, EQUIPMENT))
    assert tomllib.loads(calibration) == tomllib.loads((CALIBRATIONS / "compact.toml").read_text())
    assert tomllib.loads(equipment)["rolling_radius_m"] == load_equipment("compact").rolling_radius


def test_faults_that_a_machine_has_as_effects_are_in_the_baseline_and_are_not_doubled(tmp_path: Path) -> None:
    """A gyro's bias of the machine file is no discrepancy; what is found of it in all is divided between effect and equipment."""
    machine = tmp_path / "biased.toml"
    machine.write_text(
        'base = "l60"\nname = "biased"\n[effects.gyro_bias]\nyaw_deg_s = 1.0\n[effects.sensor_lag]\ninertial_ms = 40.0\n'
    )
    whole = found({"yaw_rate bias": {"yaw_rate.bias": 0.05}, "roll_rate lag": {"roll_rate.lag": 0.1}})
    for file, text in extended_files(whole, machine, tmp_path / "mended.toml").files.items():
        file.write_text(text)
    start = {p.name: p.value for p in baseline(machine, ()).parameters}
    sheet = load_equipment("l60").sensors
    assert start["yaw_rate.bias"] == pytest.approx(sheet.of("yaw_rate").bias + math.radians(1.0))
    assert start["roll_rate.lag"] == pytest.approx(0.04)
    after = {p.name: p.value for p in baseline(tmp_path / "mended.toml", ()).parameters}
    assert after["yaw_rate.bias"] == pytest.approx(0.05)
    assert after["roll_rate.lag"] == pytest.approx(0.1)


def test_an_older_equipment_beside_the_file_is_not_left_to_be_taken(tmp_path: Path) -> None:
    """The first diagnosis found a fault of a sensor, the sensor was mended, the second found none."""
    out = tmp_path / "mine.toml"
    for result in (RESULT, found({"payload_mass": {"payload_mass.extra_kg": 650.0}})):
        for file, text in extended_files(result, None, out).files.items():
            file.write_text(text)
    assert load_equipment(named(out, EQUIPMENT)).sensors == load_equipment("l60").sensors


def test_run_takes_what_lies_beside_the_machine(machine: Path) -> None:
    choice = Choice(scenario="standstill", changes=("surface.friction=0.5",)).on(str(machine))
    scenario = choice.load()
    assert scenario.machine == str(machine)
    assert scenario.equipment.sensors.of("pitch_rate").bias == pytest.approx(0.05)
    assert scenario.surface.friction == 0.5
    assert choice.calibration == str(machine.with_name("mine.calibration.toml"))
    assert Choice(scenario="standstill").on("compact").calibration is None, "that of the machine's family"


def test_a_calibration_made_for_factor_zero_is_refused(tmp_path: Path) -> None:
    """Tyres without damping, by hand, beside a calibration: no factor leads from there to some damping."""
    machine = tmp_path / "hand.toml"
    machine.write_text('base = "l60"\nname = "hand"\n[effects.vertical_damping]\ndamping = 0.0\n')
    named(machine, CALIBRATION).write_text((CALIBRATIONS / "l60.toml").read_text())
    result = found({"vertical_damping": {"vertical_damping.damping": 0.5}})
    with pytest.raises(BadExtension, match="damping is 0 in the baseline"):
        extended_files(result, machine, tmp_path / "out.toml")


@pytest.mark.parametrize("kind", [EQUIPMENT, CALIBRATION])
def test_what_lies_beside_a_machine_is_not_taken_for_it(kind: str, machine: Path) -> None:
    with pytest.raises(BadExtension, match=r"belongs to a machine file; give that file, mine\.toml"):
        baseline(named(machine, kind), ())


def typical(name: str) -> Applied:
    return Applied(name, "physics", {p.name: p.typical for p in effects()[name].parameters}, [])


def test_mass_moved_forward_is_conserved_and_so_is_its_moment() -> None:
    """The ECU's bodies weigh the same together; the front one's centre is that of its old mass and the moved one."""
    machine, moved = load_machine("l60"), 400.0
    nothing = {p.name: p.off for p in effects()["mass_split"].parameters}
    numbers = {
        "front.mass_kg": 2442.0,
        "front.x_m": 1.314,
        "front.z_m": 0.865,
        "rear.mass_kg": 6018.0,
        "rear.z_m": 1.28,
    }
    new = {
        f"{line.table[0]}.{line.key}": line.value
        for line in calibrated(
            [typical("mass_split")], numbers.__getitem__, {"mass_split": nothing}, machine
        ).lines
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
    assert not any(name in line for line in outcome.messages)
    again = applied_in_steps(tmp_path, result, result)
    assert calibration_of(again) == pytest.approx(calibration_of(tmp_path / "mine.toml")), "and twice is once"
