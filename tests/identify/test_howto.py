"""Both how-tos run as printed: their commands, and the descriptions that they show."""

import re
import shlex

import pytest
from typer.testing import CliRunner

from identify.command import register
from plant.sheets.machine import load_machine
from tests.conftest import ROOT

HOWTO = ROOT / "docs" / "howto"


def commands(name: str) -> list[list[str]]:
    text = (HOWTO / f"{name}.md").read_text(encoding="utf-8")
    return [shlex.split(line)[1:] for line in re.findall(r"^    (loaderhil identify .*)$", text, re.M)]


@pytest.mark.parametrize("name", ["identify-rig", "identify-field"])
def test_commands_work_as_printed(name, tmp_path, monkeypatch):
    import typer

    monkeypatch.chdir(tmp_path)
    app = typer.Typer()
    app.callback()(lambda: None)
    register(app)
    made, fitted, scored = commands(name)[:3]
    for arguments in (made, [*fitted, "--no-search"] if name == "identify-rig" else fitted, scored):
        result = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
    assert "intervals hold the truth" in result.output
    out = tmp_path / fitted[fitted.index("--out") + 1]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "95 %" in page
    assert ("Staged fit beside the joint one" in page) == (name == "identify-rig")
    assert (out / "identification.json").is_file()
    assert (out / "tyre.tir").is_file()
    assert load_machine(str(out / "machine.toml")).name


def test_a_contact_is_identified_as_the_page_says(tmp_path, monkeypatch, capsys):
    """Every command of the page on the readings that it shows; they were made with the coefficients below."""
    import json
    import sys

    from loaderhil import cli

    monkeypatch.chdir(tmp_path)
    page = (HOWTO / "identify-contact.md").read_text(encoding="utf-8")
    (rows,) = re.findall(r"```csv\n(.*?)```", page, re.S)
    (tmp_path / "readings.csv").write_text(rows, encoding="utf-8")
    for line in re.findall(r"^    (loaderhil .*)$", page, re.M):
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert not ended.value.code, capsys.readouterr()
    found = json.loads((tmp_path / "out" / "contact" / "identification.json").read_text(encoding="utf-8"))
    truth = {"qfz1": 13.7, "qfz2": 27.6, "qa1": 0.19, "qa2": 0.05, "qb1": 0.17, "qb2": 0.03}
    assert set(found["parameters"]) == set(truth)
    for name, value in truth.items():
        assert found["parameters"][name]["lower"] < value < found["parameters"][name]["upper"]
    assert found["warnings"] == []
    assert "<svg" in (tmp_path / "out" / "contact" / "report.html").read_text(encoding="utf-8")


def test_the_description_of_a_rig_that_is_shown_is_read(tmp_path):
    from identify.make.rig import Plan, make_rig
    from identify.rig.files import read_rig
    from identify.writing import write_columns
    from plant.sheets.machine import load_machine

    text = (HOWTO / "identify-rig.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```toml\n(.*?)```", text, re.S)
    (tmp_path / "rig.toml").write_text(shown, encoding="utf-8")
    run = make_rig(
        load_machine("l60"),
        1,
        None,
        Plan(piston_bar=(1.0,), inflation_bar=(), repeats=1, steps_bar=(), validation=False),
    )[0].runs[0]
    columns = {
        "time [s]": run.time,
        "drum speed [km/h]": 3.6 * run.cylinder_speed,
        "F_x [kN]": run.force / 1e3,
        "n_cs [rev/s]": run.shaft_speed,
    }
    write_columns(tmp_path / "runs" / "drive_1.csv", columns)
    read = read_rig(tmp_path / "rig.toml").runs[0]
    assert read.kind == "drive"
    assert read.force[:50] == pytest.approx(run.force[:50], nan_ok=True)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_machine_is_identified_as_the_page_says(tmp_path, monkeypatch, capsys):
    """Every command of the page, and what it promises of the machine that it makes."""
    import json
    import sys

    from loaderhil import cli

    monkeypatch.chdir(tmp_path)
    page = (HOWTO / "identify-machine.md").read_text(encoding="utf-8")
    (rows,) = re.findall(r"```csv\n(.*?)```", page, re.S)
    (tmp_path / "weighings.csv").write_text(rows, encoding="utf-8")
    printed = re.findall(r"^    (loaderhil .*)$", page, re.M)
    assert [line.split()[1] for line in printed] == ["run", "run", "identify", "run", *["identify"] * 3]
    texts = []
    for line in printed:
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            cli.main()
        texts.append(capsys.readouterr().out)
        assert not ended.value.code, texts[-1]
    folders = [shlex.split(line)[-1] for line in printed]
    found = json.loads((tmp_path / folders[2] / "identification.json").read_text(encoding="utf-8"))
    inertia = found["parameters"]["rear_yaw_inertia"]
    assert found["adequate"]
    assert inertia["lower"] < 6325.0 < inertia["upper"]
    assert inertia["lower"] > 5500.0
    mass = found["sums"]["mass without payload"]
    assert mass["lower"] < 11842.0 + 182.0 < mass["upper"]
    assert "determined only together" in texts[2]
    assert "shortest drive programme" in texts[2]
    assert "<svg" in (tmp_path / folders[2] / "report.html").read_text(encoding="utf-8")
    # weighings alone print what they printed before there were drives
    assert "height" in texts[4]
    assert "not determined: mass of each frame by itself" in texts[4]
    by_bus = json.loads((tmp_path / folders[6] / "identification.json").read_text(encoding="utf-8"))
    assert not any("force_front" in channel and "specific" not in channel for channel in by_bus["channels"])


def identify(arguments):
    import typer

    app = typer.Typer()
    app.callback()(lambda: None)
    register(app)
    return CliRunner().invoke(app, ["identify", "machine", *map(str, arguments)])


def test_a_broken_run_folder_gives_one_error_that_names_it(tmp_path):
    from bus.user_error import UserError

    (tmp_path / "drive").mkdir()
    (tmp_path / "drive" / "bus.log").write_text("no candump\n", encoding="utf-8")
    broken = identify([tmp_path / "drive"]).exception
    assert isinstance(broken, UserError)
    assert str(broken).startswith("drive: ")
    assert "\n" not in str(broken)
    gone = identify([tmp_path / "nowhere"]).exception
    assert isinstance(gone, UserError)
    assert "no such file or folder" in str(gone)


def test_a_table_of_weighings_is_told_from_a_recording(tmp_path):
    from identify.machine_command import is_weighing

    table = tmp_path / "a.csv"
    for heading, wanted in (
        ("articulation [deg],front_left [kN]", True),
        ("# scales of the yard\nfront_left [N]", True),
        ("time [s],articulation_angle [rad],yaw_rate [rad/s]", False),
        ("", False),
    ):
        table.write_text(f"{heading}\n1,2\n", encoding="utf-8")
        assert is_weighing(table) == wanted, heading
    assert not is_weighing(tmp_path)
