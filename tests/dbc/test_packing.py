"""Frames packed by compiled code against those made one at a time, and what cannot be packed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import loader_database, reference_database
from dbc.binding import Binding
from dbc.database import Database
from dbc.errors import EncodeError
from dbc.packing import Packer
from dbc.protection import Protector
from dbc.units import SI

DATABASES = (loader_database(), reference_database())
ODD = """VERSION ""
BU_: Us
BO_ 256 Motorola: 6 Us
 SG_ Crossing : 4|13@0- (0.25,-7) [-1000|1000] "m" Us
 SG_ High : 30|21@0+ (1,0) [0|2000000] "N" Us
BO_ 257 Mixed: 8 Us
 SG_ Little : 3|11@1- (-0.5,3) [-400|400] "deg" Us
 SG_ Big : 31|24@0- (0.001,0) [-8000|8000] "kN" Us
 SG_ Longest : 0|3@1+ (1,0) [0|6] "" Us
BO_ 258 LongFrame: 64 Us
 SG_ Late : 300|52@1- (1,0) [-2251799813685247|2251799813685247] "Pa" Us
 SG_ First : 7|9@0+ (2,0) [0|1000] "s" Us
BO_ 259 Short: 1 Us
 SG_ Bit : 6|1@1+ (1,0) [0|1] "" Us
"""


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    file = tmp_path_factory.mktemp("dbc") / "odd.dbc"
    file.write_text(ODD)
    return Database.from_file(file, strict=False)


def whole(codec):
    """Every signal but those of the protection, in its SI unit, from a value of its own name."""
    return {
        s.name: (SI[s.unit][0], f"{codec.name}.{s.name}")
        for s in codec.layout
        if s.name not in ("Crc", "AliveCounter")
    }


def one_by_one(messages, values, protectors):
    """The data of each frame by the plain means."""
    made = []
    for codec, signals in messages:
        data = Binding(codec, {name: unit for name, (unit, _) in signals.items()}).encode(
            [values[source] for _, source in signals.values()]
        )
        made.append(protectors[codec.name].protect(data) if codec.name in protectors else data)
    return made


def agree(messages, draw, rounds=3):
    packer = Packer(messages)
    plan = packer.plan(range(len(messages)))
    protectors = {codec.name: Protector(codec) for codec, _ in messages if codec.e2e_data_id is not None}
    for _ in range(rounds):
        vector = np.array([draw(source) for source in packer.sources])
        values = dict(zip(packer.sources, vector.tolist(), strict=True))
        frames = packer.pack(plan, vector)
        assert [frame.can_id for frame in frames] == [codec.can_id for codec, _ in messages]
        assert [frame.data for frame in frames] == one_by_one(messages, values, protectors)


def anything(database, data):
    """A number for a source: on, off and between the steps of its signal, beyond its ends, or none at all."""

    def draw(source):
        message, name = source.split(".")
        signal = database.by_name[message].by_signal[name]
        factor = SI[signal.unit][1]
        low, high = signal.raw_range
        raw = st.one_of(st.integers(low - 2, high + 2), st.integers(low, high - 1).map(lambda r: r + 0.5))
        physical = raw.map(lambda r: (r * signal.scale + signal.offset) * factor)
        ends = st.sampled_from((math.inf, -math.inf, 1e300, -1e300, 0.0, -0.0))
        none = st.just(math.nan) if signal.not_available is not None else st.nothing()
        return data.draw(st.one_of(physical, ends, none))

    return draw


@pytest.mark.parametrize("database", DATABASES, ids=["loader", "reference"])
@settings(deadline=None)  # the first call compiles
@given(data=st.data())
def test_packed_frames_are_those_of_binding_and_protector(database, data):
    codec = data.draw(st.sampled_from(list(database.by_name.values())))
    agree([(codec, whole(codec))], anything(database, data))


@pytest.mark.parametrize("database", DATABASES, ids=["loader", "reference"])
def test_many_messages_at_once_are_those_made_one_by_one(database):
    generator = np.random.default_rng(1)
    agree(
        [(codec, whole(codec)) for codec in database.by_name.values()],
        lambda source: generator.normal() * 10.0 ** generator.integers(-3, 7),
        rounds=50,
    )


def test_the_counters_go_round_as_the_protectors_do():
    codecs = [loader_database().by_name[name] for name in ("Articulation", "Limits", "BodyRates")]
    agree([(codec, whole(codec)) for codec in codecs], lambda source: 0.0, rounds=40)


@settings(deadline=None)
@given(data=st.data())
def test_byte_orders_lengths_signs_and_steps_of_all_kinds(odd, data):
    """Motorola, both orders in one message, CAN FD, 52 bits, a single bit, a negative factor."""
    codec = data.draw(st.sampled_from(list(odd.by_name.values())))
    agree([(codec, whole(codec))], anything(odd, data))


def test_signals_that_are_not_sent_are_at_rest():
    codec = loader_database().by_name["Articulation"]
    agree([(codec, {"ArticulationRate": ("rad/s", "rate")})], lambda source: 0.2)


def test_only_what_is_due_is_made_and_only_that_counts_on():
    codecs = [loader_database().by_name[name] for name in ("Articulation", "BodyRates")]
    messages = [(codec, whole(codec)) for codec in codecs]
    packer = Packer(messages)
    zeros = np.zeros(len(packer.sources))
    first, both = packer.plan([0]), packer.plan([1, 0])
    assert [frame.can_id for frame in packer.pack(first, zeros)] == [codecs[0].can_id]
    assert [frame.can_id for frame in packer.pack(both, zeros)] == [codecs[1].can_id, codecs[0].can_id]
    rates, articulation = packer.pack(both, zeros)
    assert (articulation.data[1] & 0x0F, rates.data[1] & 0x0F) == (2, 1)


def test_the_vector_has_the_order_that_was_asked_for():
    codec = loader_database().by_name["LiftPressure"]
    signals = {"LiftCylinderPressure": ("Pa", "lift")}
    packer = Packer([(codec, signals)], ["unused", "lift"])
    assert packer.sources == ("unused", "lift")
    (frame,) = packer.pack(packer.plan([0]), np.array([math.nan, 20e6]))
    assert codec.decode_dict(frame.data)["LiftCylinderPressure"] == pytest.approx(20_000.0)


def test_nan_where_no_bits_are_left_to_say_so_is_refused():
    codec = loader_database().by_name["NormalForces"]
    packer = Packer([(codec, {"FrontLeft": ("N", "force")})])
    with pytest.raises(EncodeError, match=r"NormalForces: cannot encode FrontLeft = nan kN"):
        packer.pack(packer.plan([0]), np.array([math.nan]))


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        ('0|32@1- (1,0) [-10|10] "m"', r"Odd\.X is a float; what we send cyclically"),
        ('0|53@1+ (1,0) [0|9] "m"', r"Odd\.X is an integer of 53 bits"),
    ],
)
def test_what_a_float_cannot_carry_exactly_is_refused_at_start_up(tmp_path, signal, words):
    kind = "\nSIG_VALTYPE_ 256 X : 1;" if "32@" in signal else ""
    file = tmp_path / "odd.dbc"
    file.write_text(f'VERSION ""\nBU_: Us\nBO_ 256 Odd: 8 Us\n SG_ X : {signal} Us\n{kind}\n')
    codec = Database.from_file(file).by_name["Odd"]
    with pytest.raises(ValueError, match=words):
        Packer([(codec, {"X": ("m", "x")})])
