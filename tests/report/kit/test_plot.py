"""Axes, curves, bands and histograms: nothing is lost in reduction, ticks are round, text cannot break the page."""

import itertools
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from report.kit import bands, histogram
from report.kit.axis import Axis, around, number
from report.kit.bands import Band, Interval, intervals
from report.kit.histogram import Histogram, common_end, milliseconds
from report.kit.plot import (
    BINS,
    UNITS,
    Curve,
    Mark,
    Plot,
    Timeline,
    common_range,
    events,
    markup,
    path,
    reduce,
)
from tests.report.drawn import Outline, points_of

WIDE = Axis(0.0, 10.0)


@given(st.floats(-100, 100), st.floats(1e-3, 1e6), st.integers(4, 10))
@example(2.0, 800001.0, 4)  # a step of 500000 lies in it once
def test_ticks_are_round_inside_and_about_as_many_as_wanted(start, span, count):
    low, high = start * span, start * span + span
    ticks = Axis(low, high).ticks(count)
    assert 2 <= len(ticks) <= count + 1
    assert all(low - span * 1e-6 <= t <= high + span * 1e-6 for t in ticks)
    step = ticks[1] - ticks[0]
    assert ticks[0] - step < low + span * 1e-6  # no room for another at either end
    assert ticks[-1] + step > high - span * 1e-6
    mantissa = step / 10 ** np.floor(np.log10(step * (1 + 1e-9)))
    assert min(abs(mantissa - m) for m in (1, 2, 5, 10)) < 1e-3
    assert abs(ticks[0] / step - round(ticks[0] / step)) < 1e-3


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (0.0, float("inf")), (float("nan"), 1.0)])
def test_there_is_no_axis_without_a_range(low, high):
    with pytest.raises(ValueError, match="finite"):
        Axis(low, high)


@given(st.floats(-50, 50), st.floats(0.1, 100), st.floats(0, 1))
def test_an_axis_is_linear(start, span, share):
    axis = Axis(start, start + span)
    assert float(axis.share(start + share * span)) == pytest.approx(share, abs=1e-9)


@given(st.lists(st.floats(-1e6, 1e6), max_size=20), st.lists(st.floats(-1e6, 1e6), max_size=3))
def test_an_axis_covers_all_values_and_what_must_be_seen(values, always):
    axis = around([np.array([*values, np.nan, np.inf])], always)
    assert all(axis.start < v < axis.end for v in (*values, *always))


def test_numbers_have_a_real_minus():
    assert [number(v) for v in (-0.0, -2.0, 0.5, 1e6)] == ["0", "−2", "0.5", "1e+06"]


def test_a_spike_survives_reduction():
    value = np.zeros(100_000)
    value[54_321], value[77_777] = 9.0, -7.0
    time, kept = reduce(np.arange(value.size) * 0.01, value)
    assert kept.size <= 2 * BINS
    assert kept.max() == 9.0
    assert kept.min() == -7.0
    assert time[kept.argmax()] == 543.21
    assert (np.diff(time) > 0).all()


def test_a_gap_survives_reduction():
    value = np.zeros(100_000)
    value[40_000:60_000] = np.nan
    time, kept = reduce(np.arange(value.size) * 0.01, value)
    inside = (time > 401) & (time < 599)
    assert inside.any()
    assert np.isnan(kept[inside]).all()


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=60))
def test_a_path_reads_back_to_its_samples(values):
    """To half a unit: a ten-thousandth of either axis."""
    time = np.linspace(1, 9, len(values))
    upward = Axis(-5.0, 5.0)
    ((points,),) = (points_of(path(Curve("c", time, np.array(values), "truth"), WIDE, upward)),)
    x, y = np.array(points).T
    np.testing.assert_allclose(x / UNITS * 10, time, atol=10 / UNITS)
    np.testing.assert_allclose(5 - y / UNITS * 10, values, atol=10 / UNITS)


@given(st.lists(st.integers(-3, 3), min_size=2, max_size=60))
def test_stairs_hold_each_value_until_the_next_sample(values):
    time = np.linspace(0, 10, len(values))
    curve = Curve("c", time, np.array(values, float), "limit", steps=True)
    ((points,),) = (points_of(path(curve, WIDE, Axis(-5.0, 5.0))),)
    for start, stop, value in zip(time, time[1:], values, strict=False):
        middle = UNITS * (start + stop) / 20
        level = [y for x, y in points if x <= middle][-1]
        assert 5 - level / UNITS * 10 == pytest.approx(value, abs=1e-3)
    assert points[-1][0] == UNITS


def test_a_gap_stays_a_gap():
    value = np.array([0.0, 1.0, np.nan, np.nan, 1.0, 0.0])
    assert len(points_of(path(Curve("c", np.arange(6.0), value, "truth"), WIDE, Axis(-1.0, 2.0)))) == 2


def test_the_same_plot_of_two_runs_has_one_range():
    one, two = (
        Plot(title="t", unit="N", curves=[Curve("c", np.arange(3.0), np.array(v), "truth")], always=(0.0,))
        for v in ([1.0, 2.0, 3.0], [50.0, 60.0, 70.0])
    )
    both = common_range([one, two])
    assert both.start < 0
    assert both.end > 70


def test_marks_close_together_say_their_number_only_and_stay_apart():
    marks = [Mark(t, "word", f"at {t}", "warned") for t in (1.0, 1.05, 6.0)]
    text = events(Timeline(WIDE, 10.0, marks))
    places = [float(p) for p in re.findall(r"left:([\d.]+)%", text)]
    assert min(np.diff(places)) >= 3.4
    assert text.count("<em>") == 2
    assert re.findall(r"<b>(\d)</b>", text) == ["1", "2", "3"]


def test_names_cannot_break_the_page():
    nasty = '</svg><script>"&'
    plot = Plot(title=nasty, unit=nasty, curves=[Curve(nasty, np.arange(3.0), np.arange(3.0), "truth")])
    timeline = Timeline(WIDE, 10.0, [Mark(1.0, nasty, nasty, "warned")])
    found = bands.markup([Band(nasty, (Interval(0, 9, nasty, 1),), nasty)], timeline)
    for text in (
        markup(plot, WIDE, timeline),
        found,
        histogram.markup(Histogram(nasty, np.ones(3), 5.0), 6.0),
    ):
        outline = Outline.of(text)
        assert "script" not in outline.seen
        assert outline.open == []


class Titles(HTMLParser):
    def __init__(self):
        super().__init__()
        self.bars = []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag == "i" and "style" in found:
            self.bars.append(found)


def test_a_curve_without_values_is_left_out_and_an_empty_plot_says_so():
    lost = Curve("lost", np.arange(3.0), np.full(3, np.nan), "truth")
    some = Curve("some", np.arange(3.0), np.arange(3.0), "truth")
    assert "not recorded" in markup(Plot(title="t", unit="", curves=[lost]), WIDE, Timeline(WIDE, 10.0))
    text = markup(Plot(title="t", unit="", curves=[lost, some]), WIDE, Timeline(WIDE, 10.0))
    assert "lost" not in text
    assert "some" in text


def test_intervals_cover_the_time_without_overlap():
    words = {0: ("quiet", 0), 1: ("odd", 1), 2: ("loud", 2)}
    found = intervals([0, 1, 2, 3, 4], [0, 0, 2, 2, 7], words)
    assert found == (
        Interval(0.0, 2.0, "quiet", 0),
        Interval(2.0, 4.0, "loud", 2),
        Interval(4.0, 4.0, "not available", 0),
    )


@given(st.lists(st.booleans(), min_size=1, max_size=80))
def test_the_intervals_of_a_flag_are_the_flag(flags):
    """End to end, alternating, and each sample in the interval with its value."""
    found = intervals(range(len(flags)), flags, {0: ("", 0), 1: ("set", 2)})
    assert found[0].start_s == 0
    assert found[-1].end_s == len(flags) - 1
    assert all(a.end_s == b.start_s and a.word != b.word for a, b in itertools.pairwise(found))
    for at, flag in enumerate(flags):
        (holding,) = [s for s in found[:-1] if s.start_s <= at < s.end_s] or [found[-1]]
        assert (holding.word == "set") == flag


def test_a_window_cuts_the_samples_outside():
    found = intervals([0, 1, 2, 3], [1, 0, 0, 1], {0: ("a", 0), 1: ("b", 1)}, (0.5, 2.5))
    assert found == (Interval(1.0, 2.0, "a", 0),)
    assert intervals([0, 1], [1, 1], {}, (5, 6)) == ()


def test_bars_lie_where_their_interval_is():
    text = bands.markup(
        [Band("b", (Interval(2.0, 5.0, "up", 1), Interval(5.0, 20.0, "down", 0)))], Timeline(WIDE, 10.0)
    )
    parser = Titles()
    parser.feed(text)
    assert [bar["style"] for bar in parser.bars] == [
        "left:20.000%;width:30.000%",
        "left:50.000%;width:50.000%",
    ]


@given(st.lists(st.floats(-0.5, 30), min_size=1, max_size=300))
def test_the_bars_of_a_histogram_count_every_value(values):
    """Heights are logarithmic: read back and summed they give the number of values."""
    sample = Histogram("h", np.array(values), 5.0)
    end = common_end([sample])
    text = histogram.markup(sample, end)
    heights = [int(h) for h in re.findall(r'<rect [^>]*height="(\d+)"', text)]
    low = math.log10(0.7)
    most = int(re.search(r"counts of (\d+)", text)[1])
    assert most == len(values)
    counts = np.histogram(values, histogram.BARS, (min(0.0, min(values)), end))[0]
    high = math.log10(max(counts.max(), 10) * 1.4)
    read = [10 ** (low + h / UNITS * (high - low)) for h in heights]
    assert sum(round(n) for n in read) == len(values)


def test_a_histogram_names_its_percentiles_and_its_limit():
    values = np.arange(1, 1001) / 100
    text = histogram.markup(Histogram("h", values, 5.0), 11.0)
    assert f"median {np.median(values):.2f}" in text
    assert f"99 % within {np.percentile(values, 99):.2f}" in text
    assert "permitted for 99 %: 5.0" in text
    assert "not measured" in histogram.markup(Histogram("h", np.empty(0), 5.0), 11.0)
    assert "permitted" not in histogram.markup(Histogram("h", values, float("nan")), 11.0)


def test_milliseconds_drop_what_was_not_measured():
    np.testing.assert_allclose(milliseconds([1e6, np.nan, 2.5e6]), [1.0, 2.5])


def test_a_common_end_shows_every_value_and_limit():
    shown = [Histogram("a", np.array([1.0, 7.0]), 5.0), Histogram("b", np.empty(0), 9.0)]
    assert common_end(shown) > 9.0
    assert common_end([Histogram("a", np.array([20.0]), 5.0)]) > 20.0
