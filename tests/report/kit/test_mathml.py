"""Equations as MathML: well formed, with the structure of the formula, and never lost."""

from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.models import ball, car, road, straight
from report.kit.mathml import added, mathml


def tree(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(mathml(text))


def words(node: ElementTree.Element) -> str:
    """Letters and signs in reading order, without spaces and invisible signs."""
    return "".join("".join(node.itertext()).replace("\u2061", "").split())


def test_a_fraction_has_its_factors_above_and_its_divisor_below() -> None:
    fraction = tree("r = v tan(delta) / (L (1 + K v²))").find(".//mfrac")
    assert fraction is not None
    assert words(fraction[0]) == "vtan(δ)"
    assert words(fraction[1]) == "L(1+Kv2)"


def test_a_derivative_is_one_fraction_beside_its_factor() -> None:
    whole = tree("tau dv/dt + v = v_command")
    fraction = whole.find(".//mfrac")
    assert fraction is not None
    assert (words(fraction[0]), words(fraction[1])) == ("dv", "dt")
    assert words(whole).startswith("τdvdt+v=v")


def test_powers_roots_indices_and_absolute_values() -> None:
    assert words(tree("v²").find(".//msup")[1]) == "2"  # type: ignore[index]
    assert words(tree("x^(n+1)").find(".//msup")[1]) == "n+1"  # type: ignore[index]
    assert tree("sqrt(1 + x)").find(".//msqrt") is not None
    index = tree("F_brake").find(".//msub")
    assert index is not None
    assert (words(index[0]), words(index[1])) == ("F", "brake")
    assert words(tree("|x| + ||y| - 1|")) == "|x|+||y|−1|"


def test_what_is_no_equation_stays_text() -> None:
    whole = tree("the driver sleeps: F = ???")
    assert whole.find(".//mtext") is not None
    assert "F = ???" in "".join(whole.itertext())


@pytest.mark.parametrize(
    "model", [ball.model(), car.model(), road.model(()), straight.model()], ids=lambda m: m.name
)
def test_every_equation_of_our_libraries_is_drawn(model) -> None:  # type: ignore[no-untyped-def]
    """None falls back to plain text from one end to the other."""
    for effect in model.effects:
        whole = tree(effect.equation)
        assert whole.find(".//mo") is not None, effect.equation


def test_terms_of_an_open_equation() -> None:
    whole = ElementTree.fromstring(added("yaw rate", ["d/dt steering", "play(gyro, 0.5 rad/s)"]))
    assert words(whole).startswith("yawrate+=c1")
    assert whole.find(".//mfrac") is not None


def test_a_signal_is_no_symbol_with_an_index_and_a_width_no_fraction() -> None:
    whole = ElementTree.fromstring(added("yaw", ["yaw_rate²", "play(gyro, 0.5 rad/s)"], ["yaw_rate", "gyro"]))
    texts = [e.text for e in whole.iter("mtext")]
    assert texts == ["yaw", "yaw_rate", "play(gyro, 0.5 rad/s)"]
    assert whole.find(".//msup") is not None
    assert whole.find(".//mfrac") is None


def test_a_constant_is_its_coefficient_and_dots_are_left_out_terms() -> None:
    assert words(ElementTree.fromstring(added("level", ["1", "speed"]))) == "level+=c1+c2speed"
    assert words(tree("dh/dt = ... - k h")) == "dhdt=…−kh"


def test_an_arrow_is_a_relation() -> None:
    assert words(tree("m_l -> m_l + d")) == "ml→ml+d"


@given(st.text(max_size=60))
def test_any_text_gives_well_formed_markup_that_names_it(text: str) -> None:
    clean = "".join(c for c in text if c.isprintable())
    assert ElementTree.fromstring(mathml(clean)).get("aria-label") == clean
