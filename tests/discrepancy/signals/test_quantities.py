"""Numbers as people read them say what they are: read back they are the same to so many digits, and no unit is lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.signals.quantities import figures, quantity, readable, span


@given(st.floats(-1e12, 1e12, allow_nan=False).filter(lambda x: abs(x) > 1e-12), st.integers(2, 5))
def test_what_is_written_is_the_value_to_so_many_digits(value: float, digits: int) -> None:
    assert float(figures(value, digits)) == pytest.approx(value, rel=0.5001 * 10.0 ** (1 - digits))


@pytest.mark.parametrize(
    ("value", "text"),
    [(1510.0, "1510"), (27_812.0, "27800"), (0.05, "0.05"), (-0.0, "0"), (4.84e-7, "4.84e-07"), (2.5e7, "2.5e+07")],
)  # fmt: skip
def test_a_power_of_ten_stands_only_where_zeros_would_be_many(value: float, text: str) -> None:
    assert figures(value) == text


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("1", "3"),
        ("kg m2", "3 kg·m²"),
        ("N m/rad", "3 N·m/rad"),
        ("kg.m^2/s^3", "3 kg·m²/s³"),
        ("1/s", "3 1/s"),
    ],
)
def test_units_of_sheets_and_of_models_are_shown_alike(unit: str, text: str) -> None:
    assert quantity(3.0, unit) == text


@pytest.mark.parametrize(
    ("unit", "size", "factor", "text"),
    [
        ("Pa", 1.2e7, 1e6, "MPa"),
        ("N", 6.5e4, 1e3, "kN"),
        ("N.m", 9e3, 1.0, "N·m"),
        ("rad/s", 1e5, 1.0, "rad/s"),
    ],
)
def test_large_values_have_prefixed_units(unit: str, size: float, factor: float, text: str) -> None:
    assert readable(unit, size) == (factor, text)


@pytest.mark.parametrize(
    ("start_s", "end_s", "expected"),
    [
        (60.0, 120.0, "60 to 120 s"),
        (13.3, 14.9, "13.3 to 14.9 s"),
        (13.31, 16.04, "13.3 to 16.0 s"),
        (0.02, 0.034, "0.020 to 0.034 s"),
        (46412.3, 46415.1, "46412.3 to 46415.1 s (12.8923 to 12.8931 h)"),
        (9000.0, 12600.0, "9000 to 12600 s (2.5 to 3.5 h)"),
        (345600.0, 432000.0, "345600 to 432000 s (4.0 to 5.0 d)"),
        (1.7e9, 1.7e9 + 30.0, "1700000000 to 1700000030 s"),
        (5.0, 5.0, "5.0000 to 5.0000 s"),
    ],
)
def test_a_span_has_as_many_digits_as_its_length_needs(start_s: float, end_s: float, expected: str) -> None:
    assert span(start_s, end_s) == expected
