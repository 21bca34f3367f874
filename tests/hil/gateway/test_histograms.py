"""Latency histograms: percentiles of the sample itself, files that HdrHistogram's reader reads."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.gateway.histograms import FOLD, HIGHEST_NS, Latencies, read_log, tag_of, write_log


def by_definition(values, percent):
    """HdrHistogram's: the value that this share of the sample, rounded to whole values, does not exceed."""
    rank = max(int(percent / 100 * len(values) + 0.5), 1)
    return np.sort(values)[rank - 1]


@given(st.lists(st.integers(1, HIGHEST_NS), min_size=1, max_size=300), st.floats(1, 100))
def test_percentiles_are_those_of_the_sample_to_three_digits(values, percent):
    found = Latencies(values).percentile_ns(percent)
    assert found == pytest.approx(by_definition(values, percent), rel=1e-3, abs=1)


def test_as_many_values_as_were_added_whatever_the_batches():
    latencies = Latencies()
    for value in range(1, 2 * FOLD + 100):
        latencies.add(value * 1000)
    assert latencies.count == 2 * FOLD + 99
    assert latencies.histogram.get_min_value() == 1000
    assert latencies.percentile_ns(50) == pytest.approx(FOLD * 1000, rel=0.02)


def test_values_out_of_range_count_at_its_edge():
    latencies = Latencies([-5, 0, 10 * HIGHEST_NS])
    assert latencies.count == 3
    assert latencies.histogram.get_max_value() == pytest.approx(HIGHEST_NS, rel=1e-3)


def test_memory_does_not_grow_with_the_sample():
    latencies = Latencies()
    for _ in range(3 * FOLD):
        latencies.add(12345)
    assert len(latencies._fresh) < FOLD


def test_a_log_reads_back_hop_by_hop(tmp_path):
    generator = np.random.default_rng(5)
    hops = {
        "through the gateway": generator.lognormal(10, 1, 5000).astype(int) + 1,
        "onto the ECU's bus": generator.lognormal(12, 0.3, 700).astype(int) + 1,
    }
    file = tmp_path / "latency.hlog"
    counted = {name: Latencies(values.tolist()) for name, values in hops.items()} | {"none": Latencies()}
    write_log(file, counted, start_s=1.7e9, duration_s=20.0)
    read = read_log(file)
    assert set(read) == {tag_of(name) for name in hops}
    for name, values in hops.items():
        histogram = read[tag_of(name)]
        assert histogram.get_total_count() == values.size
        for percent in (50, 99, 99.9):
            expected = by_definition(values, percent)
            assert histogram.get_value_at_percentile(percent) == pytest.approx(expected, rel=1e-3)


def test_a_log_has_the_lines_of_its_format(tmp_path):
    """HdrHistogram log format 1.2: comments, legend, then Tag=NAME,start,length,max,payload."""
    file = tmp_path / "latency.hlog"
    write_log(file, {"a b": Latencies([2_500_000])}, start_s=12.5, duration_s=3.0)
    comment, version, start, legend, line = file.read_text().splitlines()
    assert comment.startswith("#")
    assert version == "#[Histogram log format version 1.2]"
    assert start.startswith("#[StartTime: 12.500 (seconds since epoch)")
    assert legend == '"StartTimestamp","Interval_Length","Interval_Max","Interval_Compressed_Histogram"'
    tag, _, length, largest, payload = line.split(",")
    assert (tag, float(length), float(largest)) == ("Tag=a-b", 3.0, 2.0)
    assert payload.startswith("HISTFAAAA")
