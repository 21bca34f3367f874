"""Channels computed from columns, times by any usual name, and units from the command line."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.models import find_model
from diagnosis.reading.computed import computed
from diagnosis.reading.reading import ReadOptions, assigned, read_all
from diagnosis.reading.tables import Column, Unreadable, read_table
from discrepancy.signals.recording import Recording
from discrepancy.signals.units import parse_scaled
from tests.diagnosis.cases import model_file

TIME_S = np.arange(4.0)


def column(name: str, unit: str | None, *values: float) -> Column:
    return Column(name, unit, TIME_S, np.array(values))


def test_a_product_has_the_unit_of_its_factors() -> None:
    found = computed(
        "voltage * motor current / 2", [column("voltage", "mV", 1, 2, 3, 4), column("motor current", "A", 2, 2, 2, 2)]
    )  # fmt: skip
    np.testing.assert_allclose(found.value, [1e-3, 2e-3, 3e-3, 4e-3])
    assert found.unit is not None
    assert parse_scaled(found.unit).unit == parse_scaled("W").unit


@pytest.mark.parametrize(
    ("formula", "expected"),
    [("-(a - b)**2", [-1.0, -4.0, -9.0, -16.0]), ("a.b + 1 * a", [6.0, 7.0, 8.0, 9.0]), ("a/b", [2.0, 1.5, 4 / 3, 1.25])],
)  # fmt: skip
def test_formulas_follow_arithmetic(formula: str, expected: list[float]) -> None:
    columns = [column("a", "m", 2, 3, 4, 5), column("b", "m", 1, 2, 3, 4), column("a.b", "m", 4, 4, 4, 4)]
    if formula == "-(a - b)**2":
        columns[1] = column("b", "m", 1, 1, 1, 1)
    np.testing.assert_allclose(computed(formula, columns).value, expected)


@pytest.mark.parametrize(
    ("formula", "reason"),
    [("a + v", "different quantities"), ("a * lost", "no column lost"), ("a +", "neither a column nor a formula"), ("print(a)", "only")],
)  # fmt: skip
def test_a_wrong_formula_is_refused_with_its_reason(formula: str, reason: str) -> None:
    with pytest.raises(Unreadable, match=reason):
        computed(formula, [column("a", "m", 1, 2, 3, 4), column("v", "m/s", 1, 2, 3, 4)])


@pytest.mark.parametrize("heading", ["Time", "time_ms", "Time Stamp [ms]", "t (ms)", "Zeit [ms]", "elapsed"])
def test_time_is_found_by_any_usual_name(tmp_path: Path, heading: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{heading},level [m]\n0,1\n100,2\n")
    (level,) = read_table(file).columns
    assert level.time_s[-1] == pytest.approx(0.1 if "ms" in heading else 100.0)


def read(tmp_path: Path, text: str, *channels: str) -> tuple[Recording, list[str]]:
    file = tmp_path / "a.csv"
    file.write_text(text)
    said = assigned(channels)
    found = read_all(
        find_model(str(model_file(tmp_path))),
        ReadOptions(paths=[file], renamed=said.columns, units=said.units, time=said.time),
        lambda _: None,
    )
    return found.recordings[0], [c.text for c in found.complaints]


def test_the_command_line_names_time_unit_and_formula(tmp_path: Path) -> None:
    rows = "".join(f"{100 * i},{i},{2 * i},{10 + i}\n" for i in range(5))
    found, _ = read(
        tmp_path, f"tick,a [l/s],b [cm^2],h\n{rows}", "time [ms]=tick", "inflow=a / b", "level [cm]=h"
    )
    np.testing.assert_allclose(found.signals["level"].time_s, 0.1 * np.arange(5))
    np.testing.assert_allclose(found.signals["level"].value, 0.01 * (10.0 + np.arange(5)))
    np.testing.assert_allclose(found.signals["inflow"].value[1:], 5.0)  # i l/s over 2 i cm²


def test_temperatures_have_their_own_zero() -> None:
    celsius, fahrenheit = parse_scaled("°C"), parse_scaled("degF")
    assert 20.0 * celsius.factor + celsius.offset == pytest.approx(293.15)
    assert 212.0 * fahrenheit.factor + fahrenheit.offset == pytest.approx(373.15)
    assert celsius.unit == parse_scaled("K").unit
