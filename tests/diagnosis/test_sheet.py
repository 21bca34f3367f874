"""How well the sheet is known scales what the baseline may be off by."""

from dataclasses import replace
from pathlib import Path

import pytest

from diagnosis.sheet import Sheet, with_sheet
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, tank

__all__ = ["loaderhil"]


@pytest.mark.parametrize(("sheet", "sd"), [("rough", 0.06), ("datasheet", 0.02), ("weighed", 0.02 / 3.0)])
def test_priors_of_shared_parameters_scale_and_initial_states_do_not(sheet: str, sd: float) -> None:
    model = tank()
    area, level = model.nuisances
    known = replace(model, nuisances=(area, replace(level, scope="initial_uncertainty", prior_sd=0.1)))
    scaled = with_sheet(known, Sheet(sheet)).nuisances
    assert [p.prior_sd for p in scaled] == pytest.approx([sd, 0.1])
    assert scaled[0] == replace(area, prior_sd=scaled[0].prior_sd)


def test_the_command_takes_a_sheet_and_refuses_others(loaderhil: Call, tmp_path: Path) -> None:
    file = write_csv(tmp_path / "drive.csv", columns(record(1)))
    model = model_file(tmp_path, "leak")
    ended = loaderhil("diagnose", file, "--model", model, "--sheet", "rough")
    assert ended.result is not None
    assert ended.result.nuisances[0].prior_sd == pytest.approx(0.06)
    assert loaderhil("diagnose", file, "--model", model, "--sheet", "guess").code == 2
