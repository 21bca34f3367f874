"""Units of quantities and of headings."""

import numpy as np
import pytest

from discrepancy.signals.units import confusions, parse_scaled, parse_unit


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("N", "kg.m/s^2"),
        ("N.m", "J"),
        ("Pa", "N/m^2"),
        ("m/s²", "m/s^2"),
        ("m/s2", "m/s^2"),
        ("m s-2", "m/s^2"),
        ("N m / s", "W"),
        ("kg / (m . s)", "Pa.s"),
        ("rad/s", "1/s"),
    ],
)
def test_units_that_are_the_same_quantity(text: str, same: str) -> None:
    assert parse_unit(text).same_quantity(parse_unit(same))


def test_a_force_per_speed_squared_is_mass_per_length() -> None:
    assert str(parse_unit("N") / parse_unit("m/s") ** 2) == "kg/m"


@pytest.mark.parametrize(
    ("made", "text"),
    [
        ("kg.m^2/s^3", "W"),
        ("kg.m^2/s^2", "N.m"),
        ("kg/s^2", "N/m"),
        ("s^2.rad/(kg.m^2)", "rad/(N.m)"),
        ("s^3.A/(kg.m^2)", "1/V"),
        ("kg/s", "kg/s"),
        ("kg.m^2", "kg.m^2"),
        ("m/s^2", "m/s^2"),
        ("kg.m^2/(s^2.K)", "J/K"),
        ("m^2/(s^2.K)", "J/(kg.K)"),
        ("kg/(s^3.K)", "W/(m^2.K)"),
    ],
)
def test_a_unit_is_written_with_few_factors(made: str, text: str) -> None:
    assert str(parse_unit(made)) == text
    assert parse_unit(text) == parse_unit(made)


@pytest.mark.parametrize("text", ["m/s/s", "10", "s^", "m^x", "2"])
def test_what_is_no_unit_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="cannot read"):
        parse_unit(text)


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(ValueError, match="furlong"):
        parse_unit("furlong/s")


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("km/h", "m/s", 1.0 / 3.6),
        ("deg/s", "rad/s", np.pi / 180.0),
        ("°", "rad", np.pi / 180.0),
        ("kN", "N", 1e3),
        ("kNm", "N.m", 1e3),
        ("bar", "Pa", 1e5),
        ("rpm", "rad/s", 2.0 * np.pi / 60.0),
        ("mm/s²", "m/s^2", 1e-3),
        ("1/min", "1/s", 1.0 / 60.0),
        ("%", "1", 0.01),
        ("", "1", 1.0),
        ("g", "m/s^2", 9.80665),
    ],
)
def test_headings_are_converted_to_si(text: str, si: str, factor: float) -> None:
    scaled = parse_scaled(text)
    assert scaled.unit.same_quantity(parse_unit(si))
    assert scaled.factor == pytest.approx(factor, rel=1e-12)


def test_confusions_are_factors_between_units_of_the_same_quantity_both_ways() -> None:
    speeds = confusions("m/s")
    assert speeds["km/h under a heading of m/s"] == pytest.approx(3.6)
    assert speeds["m/s under a heading of km/h"] == pytest.approx(1.0 / 3.6)
    assert not any("deg" in text for text in speeds)


def test_a_power_of_many_digits_is_no_unit() -> None:
    for text in ("deg^123456", "kN" + "9" * 500):
        with pytest.raises(ValueError, match="cannot read") as error:
            parse_scaled(text)
        assert len(str(error.value)) < 1000
    assert parse_scaled("km^-2").factor == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("unit", "same"),
    [("ohm", "V/A"), ("Ω", "ohm"), ("S", "A/V"), ("F", "A.s/V"), ("C", "A.s"), ("H", "V.s/A"), ("Wb", "V.s"), ("T", "Wb/m^2"), ("ohm.F", "s")],
)  # fmt: skip
def test_electrical_units(unit: str, same: str) -> None:
    assert parse_unit(unit) == parse_unit(same)
