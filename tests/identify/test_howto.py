"""Both how-tos run as printed: their commands, and the descriptions that they show."""

import re
import shlex

import pytest
from typer.testing import CliRunner

from identify.command import register
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
    made, fitted, scored = commands(name)
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
