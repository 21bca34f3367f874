"""The way of a reaction: stamps made with known durations give them back, whatever is lost or wraps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.gateway.hops import AGE, PROCESSING, REACTION, Kind, StampFiles, hops, way_of_reactions

DURATIONS = {  # ns, all different
    "onto the plant's bus": 11,
    "wait for the gateway": 13,
    "through the gateway": 17,
    "onto the ECU's bus": 19,
    "age at tick": 5003,
    "ECU computes": 401,
    "limits onto the ECU's bus": 23,
    "limits wait for the gateway": 29,
    "limits through the gateway": 31,
    "limits onto the plant's bus": 37,
}
PERIOD = 10_000


class Bench:
    """Writes what three taps would have written."""

    def __init__(self):
        self.rows = {"plant": [], "ecu": [], "gateway_plant": [], "gateway_ecu": []}

    def sample(self, number, at_ns, *, heard=True):
        """A sample on its way to the ECU; when it was there."""
        on_bus, read, sent, arrived = np.cumsum([at_ns, *DURATIONS.values()])[1:5].tolist()
        number %= 1 << 16
        self.rows["plant"].append((Kind.SENT_SAMPLE, number, 0, at_ns))
        self.rows["gateway_plant"].append((Kind.HEARD_SAMPLE, number, on_bus, read))
        self.rows["gateway_ecu"].append((Kind.SENT_SAMPLE, number, 0, sent))
        if heard:
            self.rows["ecu"].append((Kind.HEARD_SAMPLE, number, arrived, arrived + 1))
        return arrived

    def cycle(self, echo, tick_ns, *, limits=True):
        """A cycle of the ECU that echoes `echo`."""
        echo %= 1 << 16
        sent, on_bus, read, passed, back = np.cumsum([tick_ns, *list(DURATIONS.values())[5:]])[1:].tolist()
        if limits:
            self.rows["ecu"].append((Kind.SENT_LIMITS, 0, 0, sent))
            self.rows["gateway_ecu"].append((Kind.HEARD_LIMITS, 0, on_bus, read))
            self.rows["gateway_plant"].append((Kind.SENT_LIMITS, 0, 0, passed))
            self.rows["plant"].append((Kind.HEARD_LIMITS, 0, back, back + 5))
        self.rows["ecu"].append((Kind.SENT_STATUS, echo, 0, sent + 1))
        self.rows["gateway_ecu"].append((Kind.HEARD_STATUS, echo, on_bus + 1, read))
        self.rows["gateway_plant"].append((Kind.SENT_STATUS, echo, 0, passed + 1))
        self.rows["plant"].append((Kind.HEARD_STATUS, echo, back + 1, back + 5))
        self.rows["ecu"].append((Kind.TICK, 0, 0, tick_ns))

    def files(self, *, gateway=True):
        names = [name for name in self.rows if gateway or not name.startswith("gateway")]
        empty = dict.fromkeys(self.rows, np.empty((0, 4), np.int64))
        return StampFiles(**empty | {n: np.array(self.rows[n], np.int64).reshape(-1, 4) for n in names})


def reaction(bench, number, **cycle):
    at_ns = 1_000_000 + number * PERIOD
    bench.cycle(number, bench.sample(number, at_ns) + DURATIONS[AGE], **cycle)


def test_every_hop_takes_what_it_took():
    bench = Bench()
    for number in range(20):
        reaction(bench, number)
    found = hops(way_of_reactions(bench.files()))
    assert list(found) == [*DURATIONS, PROCESSING, REACTION]
    for name, duration in DURATIONS.items():
        assert found[name].tolist() == [duration] * 20
    assert found[REACTION].tolist() == [sum(DURATIONS.values())] * 20
    assert found[PROCESSING].tolist() == [sum(DURATIONS.values()) - DURATIONS[AGE]] * 20


def test_without_a_gateway_the_way_has_fewer_hops_and_the_same_length():
    bench = Bench()
    for number in range(5):
        reaction(bench, number)
    found = hops(way_of_reactions(bench.files(gateway=False)))
    assert list(found) == ["onto the bus", AGE, "ECU computes", "limits onto the bus", PROCESSING, REACTION]
    assert found["onto the bus"].tolist() == [11 + 13 + 17 + 19] * 5
    assert found[REACTION].tolist() == [sum(DURATIONS.values())] * 5


def test_sequence_numbers_go_round():
    """16 bits last eleven minutes at 100 Hz; the second turn must not be taken for the first."""
    bench = Bench()
    numbers = [*range(40), *range(40, 1 << 16, 9_000), *range(1 << 16, (1 << 16) + 40)]
    for number in numbers:
        reaction(bench, number)
    found = hops(way_of_reactions(bench.files()))
    assert found[REACTION].tolist() == [sum(DURATIONS.values())] * len(numbers)


def test_only_the_first_cycle_that_echoes_a_sample_is_its_reaction():
    bench = Bench()
    reaction(bench, 0)
    bench.cycle(0, 1_000_000 + 7 * PERIOD)
    reaction(bench, 8)
    found = hops(way_of_reactions(bench.files()))
    assert found[REACTION].tolist() == [sum(DURATIONS.values())] * 2


def test_a_sample_overtaken_by_a_newer_one_has_no_reaction():
    bench = Bench()
    bench.sample(0, 900_000)
    reaction(bench, 1)
    assert hops(way_of_reactions(bench.files()))[REACTION].size == 1


def test_a_cycle_without_limits_is_no_reaction_and_does_not_take_anothers():
    bench = Bench()
    reaction(bench, 0)
    reaction(bench, 1, limits=False)
    reaction(bench, 2)
    way = way_of_reactions(bench.files())
    assert way["plant_sent"].tolist() == [1_000_000, 1_000_000 + 2 * PERIOD]


@given(st.data())
def test_whatever_rows_are_missing_no_hop_is_mismatched(data):
    """Rows that a tap did not write cost reactions; those that remain have their own durations."""
    bench = Bench()
    for number in range(12):
        reaction(bench, number)
    samples = {"plant": Kind.SENT_SAMPLE, "gateway_plant": Kind.HEARD_SAMPLE, "ecu": Kind.HEARD_SAMPLE}
    for name, kind in samples.items():
        lost = data.draw(st.sets(st.integers(0, 11), max_size=6))
        bench.rows[name] = [row for row in bench.rows[name] if row[0] != kind or row[1] not in lost]
    found = hops(way_of_reactions(bench.files()))
    for name, duration in DURATIONS.items():
        assert set(found[name].tolist()) <= {duration}


def test_nothing_stamped_is_nothing_measured():
    found = hops(way_of_reactions(Bench().files()))
    assert all(column.size == 0 for column in found.values())
    assert hops({}) == {}


@pytest.mark.parametrize("kind", [Kind.HEARD_SAMPLE, Kind.HEARD_LIMITS, Kind.HEARD_STATUS])
def test_sent_follows_heard(kind):
    assert Kind(kind + 1).name == kind.name.replace("HEARD", "SENT")
