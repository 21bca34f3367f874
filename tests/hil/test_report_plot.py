"""Plots: nothing is lost in reduction, ticks are round, text is escaped."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.report.plot import (
    HEIGHT,
    LEFT,
    RIGHT,
    WIDTH,
    Axis,
    Curve,
    Mark,
    Plot,
    nice_ticks,
    number,
    reduce,
    svg,
)


@given(st.floats(-100, 100), st.floats(1e-3, 1e6))
def test_ticks_are_round_and_inside(start, span):
    low, high = start * span, start * span + span
    ticks = nice_ticks(low, high)
    assert 2 <= len(ticks) <= 11
    assert all(low - span * 1e-6 <= t <= high + span * 1e-6 for t in ticks)
    step = ticks[1] - ticks[0]
    mantissa = step / 10 ** np.floor(np.log10(step * (1 + 1e-9)))
    assert min(abs(mantissa - m) for m in (1, 2, 5, 10)) < 1e-3
    assert abs(ticks[0] / step - round(ticks[0] / step)) < 1e-3


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (0.0, float("inf")), (float("nan"), 1.0)])
def test_no_ticks_without_a_range(low, high):
    with pytest.raises(ValueError, match="finite"):
        nice_ticks(low, high)


def test_a_spike_survives_reduction():
    value = np.zeros(100_000)
    value[54_321], value[77_777] = 9.0, -7.0
    time, kept = reduce(np.arange(value.size) * 0.01, value)
    assert kept.size <= 2 * 560
    assert kept.max() == 9.0
    assert kept.min() == -7.0
    assert time[kept.argmax()] == 543.21
    assert (np.diff(time) > 0).all()


def test_a_gap_stays_a_gap():
    time, value = np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    plot = Plot(title="t", unit="", curves=[Curve("c", time, value, "truth")])
    path = re.search(r'<path class="truth" d="([^"]+)"', svg(plot, "p"))[1]
    assert path.count("M") == 2


def test_the_ends_of_a_curve_lie_on_the_axes():
    """0 s is the left edge, the last second the right one."""
    time, value = np.linspace(0, 10, 11), np.linspace(0, 1, 11)
    path = re.search(
        r' d="([^"]+)"', svg(Plot(title="t", unit="", curves=[Curve("c", time, value, "x")]), "p")
    )[1]
    points = [tuple(map(float, p.split())) for p in re.split("[ML]", path)[1:]]
    assert points[0][0] == LEFT
    assert points[-1][0] == WIDTH - RIGHT
    assert points[0][1] > points[-1][1]  # up is smaller on a screen
    assert all(0 < y < HEIGHT for _, y in points)


@given(st.floats(-50, 50), st.floats(0.1, 100), st.floats(0, 1))
def test_an_axis_is_linear(start, span, share):
    axis = Axis(start, start + span, 10, 110)
    assert float(axis.at(start + share * span)) == pytest.approx(10 + 100 * share, abs=1e-6)


def test_names_cannot_break_the_page():
    nasty = '<script>"&'
    plot = Plot(
        title=nasty,
        unit=nasty,
        curves=[Curve(nasty, np.arange(3.0), np.arange(3.0), "truth")],
        marks=[Mark(1.0, nasty, "warned")],
    )
    seen = []

    class Parser(HTMLParser):
        def handle_starttag(self, tag, attrs):
            seen.append(tag)

    Parser().feed(svg(plot, "p"))
    assert "script" not in seen
    assert "svg" in seen


def test_a_curve_without_values_is_left_out_and_an_empty_plot_says_so():
    none = Curve("none", np.arange(3.0), np.full(3, np.nan), "truth")
    assert "not recorded" in svg(Plot(title="t", unit="", curves=[none]), "p")


def test_numbers_have_a_real_minus():
    assert [number(v) for v in (-0.0, -2.0, 0.5, 1e6)] == ["0", "−2", "0.5", "1e+06"]
