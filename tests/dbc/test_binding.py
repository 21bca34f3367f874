"""SI values in and out of the bits: factors, saturation, "not available", and what is refused at start-up."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc import loader_database, reference_database
from dbc.binding import Binding
from dbc.database import Database
from dbc.errors import EncodeError
from dbc.units import SI

ARTICULATION = loader_database().by_name["Articulation"]
FORCE = loader_database().by_name["TyreForceFrontLeft"]
ANGLES = Binding(ARTICULATION, {"ArticulationAngle": "rad", "ArticulationRate": "rad/s"})
EVERY = [codec for make in (loader_database, reference_database) for codec in make().by_name.values()]


def whole(codec):
    """A binding of every signal, in the SI unit of its DBC unit."""
    return Binding(codec, {signal.name: SI[signal.unit][0] for signal in codec.layout})


@pytest.mark.parametrize(
    ("message", "signal", "unit", "si", "physical"),
    [
        ("Articulation", "ArticulationAngle", "rad", math.pi / 6, 30.0),
        ("VehicleSpeed", "WheelBasedVehicleSpeed", "m/s", 5.0, 18.0),
        ("LiftPressure", "LiftCylinderPressure", "Pa", 20e6, 20_000.0),
        ("TurningTorque", "JointTorque", "N.m", -12_340.0, -12.34),
        ("EcuStatus", "ExecutionTime", "s", 300e-6, 300.0),
        ("DriverDemand", "BrakeDemand", "1", 0.25, 25.0),
    ],
)
def test_units_by_hand(message, signal, unit, si, physical):
    codec = loader_database().by_name[message]
    data = Binding(codec, {signal: unit}).encode([si])
    assert codec.decode_dict(data)[signal] == pytest.approx(physical, rel=1e-12)
    assert Binding(codec, {signal: unit}).decode(data)[0] == pytest.approx(si, rel=1e-12)


@given(st.sampled_from(EVERY), st.data())
def test_what_is_sent_is_received_within_half_a_step(codec, data):
    binding = whole(codec)
    sent = [
        data.draw(st.floats(low, high))
        for low, high in (
            sorted(bound * SI[s.unit][1] for bound in (s.minimum, s.maximum)) for s in codec.layout
        )
    ]
    received = binding.decode(binding.encode(sent))
    for signal, there, here in zip(codec.layout, sent, received, strict=True):
        step = abs(signal.scale) * SI[signal.unit][1]
        assert abs(there - here) <= 0.5 * step * (1 + 1e-6), signal.name


@given(st.sampled_from(EVERY), st.binary(min_size=8, max_size=8))
def test_decode_is_the_codec_times_the_factor_or_nan_outside_the_range(codec, data):
    physical = codec.decode(data[: codec.length])
    for signal, si, value in zip(
        codec.layout, whole(codec).decode(data[: codec.length]), physical, strict=True
    ):
        margin = abs(signal.scale) * 1e-3
        inside = signal.minimum - margin <= value <= signal.maximum + margin
        if inside or signal.choices:
            assert si == value * SI[signal.unit][1], signal.name
        else:
            assert math.isnan(si), signal.name


@given(st.sampled_from(EVERY), st.booleans())
def test_beyond_the_range_the_nearest_end_is_sent(codec, upwards):
    """An infinite value too: it is a large one."""
    for value in (1e9, math.inf):
        data = whole(codec).encode([value if upwards else -value] * len(codec.layout))
        for signal, sent in zip(codec.layout, codec.decode(data), strict=True):
            bound = signal.maximum if upwards else signal.minimum
            assert abs(sent - bound) < abs(signal.scale), signal.name
            assert signal.minimum - 1e-9 <= sent <= signal.maximum + 1e-9, signal.name


def test_nan_is_sent_as_not_available_and_comes_back_as_nan():
    """Signed: most negative number; unsigned: all ones (J1939-71, 5.1.4); value table: its own entry."""
    data = ANGLES.encode([math.nan, 0.1])
    assert int.from_bytes(data, "little") >> 12 & 0xFFFF == 0x8000
    angle, rate = ANGLES.decode(data)
    assert math.isnan(angle)
    assert rate == pytest.approx(0.1, abs=1e-4)
    speed = Binding(loader_database().by_name["VehicleSpeed"], {"WheelBasedVehicleSpeed": "m/s"})
    assert speed.encode([math.nan])[1:3] == b"\xff\xff"
    state = Binding(ARTICULATION, {"State": "1"})
    assert state.decode(state.encode([math.nan])) == (3,)


def test_nan_where_no_bits_are_left_to_say_so_is_refused():
    forces = Binding(loader_database().by_name["NormalForces"], {"FrontLeft": "N"})
    with pytest.raises(EncodeError, match=r"NormalForces: cannot encode FrontLeft = nan"):
        forces.encode([math.nan])


def test_signals_left_out_are_not_available_and_protection_is_left_to_the_protector():
    values = ARTICULATION.decode_dict(ANGLES.encode([0.0, 0.0]))
    assert values["State"] == 3
    assert values["Crc"] == values["AliveCounter"] == values["SampleSequence"] == 0
    alone = FORCE.decode_dict(Binding(FORCE, {"Slip": "1"}).encode([0.0]))
    assert alone["Longitudinal"] == -0x8000 * 0.005 < FORCE.by_signal["Longitudinal"].minimum
    assert alone["SlipValid"] == 0


def test_order_is_that_of_the_binding():
    forward = Binding(ARTICULATION, {"ArticulationAngle": "rad", "SampleSequence": "1"})
    backward = Binding(ARTICULATION, {"SampleSequence": "1", "ArticulationAngle": "rad"})
    data = forward.encode([0.25, 77])
    assert data == backward.encode([77, 0.25])
    assert forward.decode(data) == backward.decode(data)[::-1]


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        (
            {"ArticulationAngle": "deg"},
            r"Articulation\.ArticulationAngle: unit 'deg' converts to rad, but deg",
        ),
        ({"ArticulationAngle": "m"}, r"Articulation\.ArticulationAngle: .* but m is wanted"),
        ({"Angle": "rad"}, r"Articulation has no signal Angle; it has Crc, "),
    ],
)
def test_a_wrong_unit_or_name_is_refused_at_start_up(signals, words):
    with pytest.raises(ValueError, match=words):
        Binding(ARTICULATION, signals)


def test_what_the_dbc_can_be_that_a_binding_cannot_use(tmp_path):
    file = tmp_path / "other.dbc"
    file.write_text(
        'VERSION ""\nBU_: A\n'
        'BO_ 1 Paged: 8 A\n SG_ Page M : 0|8@1+ (1,0) [0|0] "" A\n SG_ X m0 : 8|8@1+ (1,0) [0|0] "m" A\n\n'
        'BO_ 2 Odd: 8 A\n SG_ Weight : 0|8@1+ (1,0) [0|0] "stone" A\n'
    )
    other = Database.from_file(file).by_name
    with pytest.raises(ValueError, match="Paged is multiplexed"):
        Binding(other["Paged"], {"X": "m"})
    with pytest.raises(ValueError, match="unit 'stone' is not known"):
        Binding(other["Odd"], {"Weight": "kg"})
