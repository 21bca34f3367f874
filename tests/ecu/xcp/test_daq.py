"""Lists of measurements: every packet of a list is of one cycle, and a list that cannot be sent does not start."""

import itertools
import random
import struct

import pytest

from ecu.measure.measurements import measurements
from ecu.xcp.packets import Error
from tests.ecu.xcp.tool import Ecu

ADDRESS = {row.name: row.address for row in measurements()}
TICK_US = 10_000


def refusal(error: Error) -> bytes:
    return bytes((0xFE, error))


def allocate(ecu: Ecu, *entries: list[int]) -> None:
    """Lists, each with the number of entries of its packets."""
    assert ecu.ask("d6") == b"\xff"
    assert ecu.ask(struct.pack("<BxH", 0xD5, len(entries))) == b"\xff"
    for k, odts in enumerate(entries):
        assert ecu.ask(struct.pack("<BxHB", 0xD4, k, len(odts))) == b"\xff"
    for k, odts in enumerate(entries):
        for j, count in enumerate(odts):
            assert ecu.ask(struct.pack("<BxHBB", 0xD3, k, j, count)) == b"\xff"


def place(ecu: Ecu, daq: int, odt: int, *names: str) -> None:
    """Fill the entries of a packet."""
    size = {row.name: row.size for row in measurements()}
    assert ecu.ask(struct.pack("<BxHBB", 0xE2, daq, odt, 0)) == b"\xff"
    for name in names:
        assert ecu.ask(struct.pack("<BBBBI", 0xE1, 0xFF, size[name], 0, ADDRESS[name])) == b"\xff"


def mode(ecu: Ecu, daq: int, *, timestamp: bool = False, prescaler: int = 1) -> bytes:
    return ecu.ask(struct.pack("<BBHHBB", 0xE0, 0x10 * timestamp, daq, 0, prescaler, 0))


@pytest.fixture
def ecu(make_ecu):
    ecu = make_ecu()
    ecu.cycles(20)
    ecu.ask("ff00")
    return ecu


def test_all_packets_of_a_cycle_are_of_that_cycle(ecu):
    allocate(ecu, [0, 1, 1], [1])
    place(ecu, 0, 1, "echo")
    place(ecu, 0, 2, "input.wheel_speed_1")
    place(ecu, 1, 0, "estimate.normal_1")
    assert mode(ecu, 0, timestamp=True) == b"\xff"
    for daq in (0, 1):
        assert ecu.ask(struct.pack("<BBH", 0xDE, 2, daq)) == bytes((0xFF, 3 * daq))
    assert ecu.ask("dd01") == b"\xff"
    for _ in range(25):
        ecu.machine.values["wheel_speed_1"] = 0.001 * ecu.machine.tick
        head, echo, speed, load = (frame.data for frame in ecu.cycles(1))
        assert [head[0], echo[0], speed[0], load[0]] == [0, 1, 2, 3]
        assert struct.unpack("<I", head[1:])[0] == ecu.now_ns // 1000
        assert struct.unpack("<f", echo[1:])[0] == ecu.cycle.values["echo"]
        assert struct.unpack("<f", speed[1:])[0] == pytest.approx(ecu.cycle.inputs["wheel_speed_1"], rel=1e-6)
        assert struct.unpack("<f", load[1:])[0] == pytest.approx(ecu.cycle.values["normal_1"], rel=1e-6)
    assert ecu.ask("fd")[1] == 0x40
    assert ecu.ask("dd00") == b"\xff"
    assert ecu.cycles(3) == []


def test_a_prescaler_leaves_cycles_out(ecu):
    allocate(ecu, [3])
    place(ecu, 0, 0, "state", "warning_level", "limit.cause")
    mode(ecu, 0, timestamp=True, prescaler=4)
    ecu.ask("de010000")
    stamps = [struct.unpack("<I", f.data[1:5])[0] for f in ecu.cycles(16)]
    assert [b - a for a, b in itertools.pairwise(stamps)] == [4 * TICK_US] * 3
    assert len(stamps) == 4


def test_a_packet_holds_no_more_than_a_frame(ecu):
    allocate(ecu, [2])
    place(ecu, 0, 0, "estimate.normal_1")
    write = struct.pack("<BBBBI", 0xE1, 0xFF, 4, 0, ADDRESS["estimate.normal_2"])
    assert ecu.ask(write) == refusal(Error.DAQ_CONFIG)


def test_a_timestamp_needs_its_room(ecu):
    allocate(ecu, [1])
    place(ecu, 0, 0, "estimate.normal_1")
    mode(ecu, 0, timestamp=True)
    assert ecu.ask("de010000") == refusal(Error.DAQ_CONFIG)
    assert ecu.cycles(2) == []


def test_a_list_with_open_entries_does_not_start(ecu):
    allocate(ecu, [2])
    place(ecu, 0, 0, "state")
    assert ecu.ask("de010000") == refusal(Error.DAQ_CONFIG)


def test_a_running_list_cannot_be_changed(ecu):
    allocate(ecu, [1])
    place(ecu, 0, 0, "state")
    ecu.ask("de010000")
    assert mode(ecu, 0) == refusal(Error.DAQ_ACTIVE)
    assert ecu.ask("e20000000000") == refusal(Error.DAQ_ACTIVE)
    assert ecu.ask("d5000100") == refusal(Error.DAQ_ACTIVE)


def test_lists_are_allocated_in_the_standards_order(ecu):
    assert ecu.ask("d5000100") == refusal(Error.SEQUENCE)  # FREE_DAQ comes first
    allocate(ecu, [1])
    assert ecu.ask("d400000001") == refusal(Error.SEQUENCE)  # packets before entries
    assert ecu.ask("d500ffff") == refusal(Error.SEQUENCE)
    ecu.ask("d6")
    assert ecu.ask("d500ffff") == refusal(Error.MEMORY_OVERFLOW)


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("e2000900 0000", Error.OUT_OF_RANGE),  # no such list
        ("e2000000 0500", Error.OUT_OF_RANGE),  # no such packet
        ("e1ff0400 00000200", Error.SEQUENCE),  # the pointer is beyond the last entry
        ("e0020000 00000100", Error.MODE_NOT_VALID),  # stimulation
        ("e0000000 05000100", Error.OUT_OF_RANGE),  # no such event
        ("e0000000 00000000", Error.OUT_OF_RANGE),  # prescaler 0
        ("de050000", Error.MODE_NOT_VALID),
        ("dd05", Error.MODE_NOT_VALID),
        ("d7000100", Error.OUT_OF_RANGE),
    ],
)  # fmt: skip
def test_wrong_arguments_have_their_codes(ecu, command, error):
    allocate(ecu, [1])
    place(ecu, 0, 0, "state")
    assert ecu.ask(command.replace(" ", "")) == refusal(error)


def test_only_measurements_can_be_listed(ecu):
    allocate(ecu, [1])
    ecu.ask("e20000000000")
    assert ecu.ask(struct.pack("<BBBBI", 0xE1, 0xFF, 4, 0, 0x0001_0000)) == refusal(Error.ACCESS_DENIED)


def test_random_commands_are_all_answered_and_disturb_no_estimate(make_ecu):
    rng = random.Random(5)
    ecu, plain = make_ecu(), Ecu()
    kinds = [*range(0xD3, 0x100)]
    for _ in range(60):
        for _ in range(60):
            packet = bytes(
                (
                    rng.choice(kinds),
                    *rng.choices((0, 0, 1, 2, 4, 0xFF, rng.randrange(256)), k=rng.randrange(8)),
                )
            )
            connected = packet[0] == 0xFF or ecu.answers("fd")
            answers = ecu.answers(packet)
            assert len(answers) >= bool(connected and packet[0] != 0xFF)
            assert all(answer[0] in (0xFF, 0xFE) and len(answer) <= 8 for answer in answers)
        for frame in ecu.cycles(1):
            assert frame.data[0] < 0xFC or frame.data[0] == 0xFD
        plain.cycles(1)
        assert ecu.cycle.values == plain.cycle.values  # nobody can guess the key
