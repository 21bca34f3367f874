"""Contact patch and vertical stiffness: given back from readings, intervals that hold, and sheets that are refused."""

import json
import shutil

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from bus.user_error import UserError
from identify.command import register
from identify.contact import at_nominal, fitted
from identify.reading import BadRecording
from identify.sheet import read_sheet
from identify.tyre.parameters import Nominal
from identify.tyre.patch import deflection, fit, laws, nominal_stiffness
from tests.conftest import ROOT

NOMINAL = Nominal(load=34e3, pressure=3.5e5, radius=0.743)
LOAD = np.array([12.0, 20.0, 28.0, 37.0, 46.0, 55.0]) * 1e3
UNITS = {"load": "N", "length": "m", "width": "m"}


def depth(load):
    """Deflection under a load, from 34e3 (13.7 d + 27.6 d^2) = load."""
    return 0.743 * (-13.7 + np.sqrt(13.7**2 + 4.0 * 27.6 * load / 34e3)) / (2.0 * 27.6)


def sheet(**columns):
    return {"load": LOAD, **columns}


def test_exact_readings_give_back_their_coefficients():
    share = LOAD / 34e3
    found, left_out = fitted(
        sheet(
            deflection=depth(LOAD),
            length=2.0 * 0.743 * (0.11 * np.sqrt(share) + 0.10 * share),
            width=2.0 * 0.743 * (0.20 * np.cbrt(share) + 0.05 * share),
        ),
        NOMINAL,
    )
    assert left_out == []
    assert found["deflection"].coefficients == pytest.approx([13.7, 27.6])
    assert found["length"].coefficients == pytest.approx([0.11, 0.10])
    assert found["width"].coefficients == pytest.approx([0.20, 0.05])
    assert all(f.constant == 0.0 for f in found.values())
    said = at_nominal(found, NOMINAL)
    assert said["deflection at nominal load"][0] == pytest.approx(1e3 * depth(34e3))
    rise = (34e3 + 10.0 - (34e3 - 10.0)) / (depth(34e3 + 10.0) - depth(34e3 - 10.0))
    assert said["vertical stiffness at nominal load"][0] == pytest.approx(rise / 1e3, rel=1e-5)
    assert said["half length at nominal load"][0] == pytest.approx(1e3 * 0.743 * 0.21)


def test_a_loaded_radius_is_the_deflection_below_the_unloaded_one():
    by_radius, _ = fitted(sheet(loaded_radius=0.743 - depth(LOAD)), NOMINAL)
    assert by_radius["deflection"].coefficients == pytest.approx([13.7, 27.6])


def test_intervals_of_few_readings_hold_the_truth_as_often_as_they_say():
    law, random = laws(NOMINAL)["length"], np.random.default_rng(5)
    load = np.array([12e3, 25e3, 38e3, 50e3])
    value = law.rows(load) @ [0.11, 0.10]
    held = 0
    for _ in range(1000):
        i = fit(law, load, value + 2e-3 * random.standard_normal(4)).interval(0)
        held += i.lower < 0.11 < i.upper
    # 950 +- 7 (one standard deviation); with 1.96 in place of Student's 4.3 it would be some 815
    assert 925 < held < 975


def test_a_zero_that_is_wrong_is_said_and_one_that_is_right_is_not():
    random = np.random.default_rng(6)
    noise = 2e-4 * random.standard_normal(LOAD.size)
    right, _ = fitted(sheet(deflection=depth(LOAD) + noise), NOMINAL)
    wrong, _ = fitted(sheet(deflection=depth(LOAD) + noise + 8e-3), NOMINAL)
    assert right["deflection"].constant == 0.0
    assert wrong["deflection"].constant < -3e3  # 8 mm at some 600 kN/m


def test_a_right_zero_is_called_wrong_once_in_a_hundred_sheets():
    law, random = laws(NOMINAL)["deflection"], np.random.default_rng(8)
    x = depth(LOAD)
    called = sum(
        bool(fit(law, x, LOAD + 150.0 * random.standard_normal(x.size)).constant) for _ in range(2000)
    )
    # 20 +- 4.5 (one standard deviation)
    assert 6 < called < 38


def test_the_inverse_of_the_vertical_law_and_its_slope():
    share = np.linspace(0.1, 2.0, 9)
    for q1, q2 in ((13.7, 27.6), (13.7, 0.0), (20.0, -5.0)):
        d = deflection(share, q1, q2)
        assert q1 * d + q2 * d**2 == pytest.approx(share, rel=1e-12)
        at, h = deflection(np.float64(1.0), q1, q2), 1e-6
        slope = ((q1 * (at + h) + q2 * (at + h) ** 2) - (q1 * (at - h) + q2 * (at - h) ** 2)) / (2.0 * h)
        assert nominal_stiffness(q1, q2, NOMINAL) == pytest.approx(34e3 / 0.743 * slope, rel=1e-6)


def test_two_terms_need_different_loads():
    found, left_out = fitted({"load": np.full(5, 30e3), "length": np.full(5, 0.3)}, NOMINAL)
    assert found == {}
    assert "at least 3 are needed" in left_out[0]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({}, "has loads alone"),
        ({"deflection": depth(LOAD), "loaded_radius": 0.743 - depth(LOAD)}, "has both"),
        ({"loaded_radius": 0.8 - depth(LOAD)}, "unloaded radius of this machine is 0.743 m"),
        ({"length": 1e3 * LOAD / 1e5}, "is its unit right"),
        ({"length": -LOAD / 1e5}, "not above 0"),
        ({"width": np.where(LOAD > 5e4, np.inf, 0.2)}, "not finite"),
    ],
)
def test_readings_that_a_tyre_cannot_have_are_refused(columns, message):
    with pytest.raises(ValueError, match=message):
        fitted(sheet(**columns), NOMINAL)


def test_a_sheet_has_units_empty_cells_and_comments(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("# press\nload [kN],length [mm],width [cm]\n10,200,\n20,,21.5\n", encoding="utf-8")
    read = read_sheet(file, UNITS, ("load",), "readings")
    assert read["load"].tolist() == [10e3, 20e3]
    assert read["length"] == pytest.approx([0.2, np.nan], nan_ok=True)
    assert read["width"] == pytest.approx([np.nan, 0.215], nan_ok=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no readings; a heading like 'load"),
        ("load [kN]\n", "has no readings"),
        ("load,length [mm]\n1,2\n", "'load'"),
        ("load [m],length [mm]\n1,2\n", "needs a unit of N"),
        ("load [kN],height [mm]\n1,2\n", "none of load, length, width"),
        ("length [mm]\n2\n", "has no column load"),
        ("load [kN],load [N]\n1,2\n", "two columns load"),
        ("load [kN],length [mm]\n1,2\n,3\n", r"a.csv:3: load is no number"),
        ("load [kN],length [mm]\n1,two\n", r"a.csv:2: length is no number"),
    ],
)
def test_a_sheet_that_cannot_be_read_names_its_line_or_column(tmp_path, text, message):
    file = tmp_path / "a.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadRecording, match=message):
        read_sheet(file, UNITS, ("load",), "readings")


def run(*arguments):
    app = typer.Typer()
    app.callback()(lambda: None)
    register(app)
    return CliRunner().invoke(app, ["identify", "contact", *map(str, arguments)])


def test_loads_beside_the_nominal_one_are_a_warning_and_too_few_end_inconclusive(tmp_path):
    low, few = tmp_path / "low.csv", tmp_path / "few.csv"
    rows = "".join(f"{n / 1e3},{1e3 * d}\n" for n, d in zip(LOAD[:3], depth(LOAD[:3]), strict=True))
    low.write_text("load [kN],deflection [mm]\n" + rows, encoding="utf-8")
    few.write_text("load [kN],deflection [mm]\n20,30\n", encoding="utf-8")
    result = run(low, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "34.0 kN lies outside the readings (12.0 to 28.0 kN)" in result.output
    assert json.loads((tmp_path / "out" / "identification.json").read_text())["warnings"]
    result = run(few, "--out", tmp_path / "none")
    assert result.exit_code == 5
    assert "nothing can be identified: deflection: 1 readings" in result.output
    assert not (tmp_path / "none").exists()


def test_a_machine_whose_tyre_is_a_tir_file_cannot_take_another(tmp_path):
    from plant.sheets.machine import MACHINES

    text = (MACHINES / "l60.toml").read_text(encoding="utf-8").replace("[tyre]", '[tyre]\ntir = "t.tir"', 1)
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "tests" / "fuzz" / "corpus" / "tyre.tir", tmp_path / "t.tir")
    file = tmp_path / "r.csv"
    file.write_text("load [kN],deflection [mm]\n10,15\n20,28\n30,41\n40,53\n", encoding="utf-8")
    error = run(file, "--machine", tmp_path / "m.toml", "--out", tmp_path / "out").exception
    assert isinstance(error, UserError)
    assert "takes its tyre from a .tir file" in str(error)
