"""docs/howto/use-fmu.md, followed as printed with the tank of the tests."""

import re
import shlex
import sys

import numpy as np
import pytest

from loaderhil import cli
from tests.conftest import ROOT
from tests.fmi.fmus import TANK, built

PAGE = (ROOT / "docs/howto/use-fmu.md").read_text("utf-8")
COMMANDS = re.findall(r"^    (loaderhil .*)$", PAGE, re.MULTILINE)
COMPANION, PLANT = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


def called(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", shlex.split(command))
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert not ended.value.code, command


def test_the_commands_of_the_page_end_as_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    built(TANK, tmp_path)
    t = np.arange(0.0, 115.0, 0.1)
    inflow = np.random.default_rng(1).uniform(0.0, 0.2, 40)[(t / 3.0 + 1e-9).astype(int)]
    level = 1.0 + 0.02 * np.cumsum(inflow)
    columns = zip(t.tolist(), inflow.tolist(), level.tolist(), strict=True)
    rows = "".join(f"{a:.1f},{b!r},{c!r}\n" for a, b, c in columns)
    (tmp_path / "today.csv").write_text(f"time [s],inflow [m^3/s],level [m]\n{rows}")
    assert [c.split()[1] for c in COMMANDS] == ["model", "conceal", "diagnose", "score", "export-fmu", "run"]
    called(COMMANDS[0], monkeypatch)
    (tmp_path / "tank.toml").write_text(COMPANION)
    for command in COMMANDS[1:4]:
        capsys.readouterr()
        called(command, monkeypatch)
    said = capsys.readouterr().out
    assert "passed" in said
    assert "leak" in said
    called(COMMANDS[4], monkeypatch)
    called(COMMANDS[5] + " --set duration_s=1", monkeypatch)
    assert (tmp_path / "out/fmu/bus.log").stat().st_size > 0


def test_the_example_of_connections_names_what_exists():
    import tomllib

    from fmi.quantities import COMMANDS as KNOWN
    from fmi.quantities import PLACES

    plant = tomllib.loads(PLANT)["plant"]
    assert set(plant["inputs"].values()) <= set(KNOWN)
    assert {*plant["outputs"], *plant["constants"]} <= set(PLACES)
