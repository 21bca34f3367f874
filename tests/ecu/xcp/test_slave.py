"""The XCP slave answers as the standard says, byte by byte, and lets nobody calibrate without the key."""

import struct
import zlib

import pytest

from bus.frame import FD, Frame
from ecu.measure.access import CALIBRATE, key_of
from ecu.measure.measurements import MeasuredImage, measurements
from ecu.measure.parameters import calibration_numbers
from ecu.xcp.packets import LEAST_LENGTH, Command, Error
from ecu.xcp.slave import SILENCE_NS
from tests.ecu.xcp.tool import CHANNEL, SECRET, Ecu

NUMBERS = {number.name: number for number in calibration_numbers()}
ADDRESS = {row.name: row.address for row in measurements()}
CONNECT = "ff00"


def refusal(error: Error) -> bytes:
    return bytes((0xFE, error))


@pytest.fixture
def ecu(make_ecu):
    ecu = make_ecu()
    ecu.cycles(60)
    ecu.ask(CONNECT)
    return ecu


@pytest.fixture
def unlocked(ecu):
    ecu.unlock()
    return ecu


def set_mta(ecu: Ecu, address: int) -> None:
    assert ecu.ask(struct.pack("<BHBI", 0xF6, 0, 0, address)) == b"\xff"


def write(ecu: Ecu, name: str, value: float) -> bytes:
    set_mta(ecu, NUMBERS[name].address)
    return ecu.ask(b"\xf0\x04" + struct.pack("<f", value))


def read(ecu: Ecu, address: int) -> float:
    answer = ecu.ask(struct.pack("<BBBBI", 0xF4, 4, 0, 0, address))
    return struct.unpack("<f", answer[1:])[0]


def payload(ecu: Ecu) -> float:
    return ecu.cycle.values["payload"]


def test_a_slave_without_a_tool_is_silent(make_ecu):
    ecu = make_ecu()
    for command in range(0xFF):
        assert ecu.answers(bytes((command,)) + bytes(7)) == []
    # resources CAL/PAG and DAQ, Intel, bytes, slave block mode, 8 bytes each way, version 1 of both layers
    assert ecu.ask(CONNECT) == bytes.fromhex("ff05c00808000101")


@pytest.mark.parametrize("command", LEAST_LENGTH, ids=lambda c: c.name)
def test_a_command_that_is_too_short_is_a_syntax_error(ecu, command):
    for length in range(1, LEAST_LENGTH[command]):
        assert ecu.ask(bytes((command,)) + bytes(length - 1)) == refusal(Error.CMD_SYNTAX)


def test_unknown_commands_are_refused(ecu):
    for command in set(range(256)) - set(Command):
        assert ecu.ask(bytes((command,)) + bytes(7)) == refusal(Error.CMD_UNKNOWN)


def test_frames_of_other_kinds_are_no_commands(ecu):
    for frame in (
        Frame(CHANNEL.receive, b"\xfd", 0, FD),
        Frame(CHANNEL.receive ^ 1, b"\xfd"),
        Frame(CHANNEL.receive, b""),
        Frame(CHANNEL.send, b"\xfd"),
    ):
        assert ecu.service.receive(frame, 0) == []


def test_synch_is_answered_by_its_own_error(ecu):
    assert ecu.ask("fc") == refusal(Error.CMD_SYNCH)


def test_measurements_read_are_those_of_the_last_cycle(ecu):
    for row in measurements():
        values = ecu.cycle.inputs if row.source == "input" else ecu.cycle.values
        image = ecu.ask(struct.pack("<BBBBI", 0xF4, row.size, 0, 0, row.address))[1:]
        expected = struct.pack("<f", values[row.key]) if row.size == 4 else bytes((int(values[row.key]),))
        assert image == expected, row.name


def test_upload_goes_on_where_the_last_one_ended(ecu):
    set_mta(ecu, ADDRESS["estimate.normal_1"])
    first, second = (ecu.ask("f504")[1:] for _ in range(2))
    assert first + second == struct.pack("<ff", ecu.cycle.values["normal_1"], ecu.cycle.values["normal_2"])


def test_a_long_upload_comes_in_several_packets(ecu):
    set_mta(ecu, ADDRESS["estimate.normal_1"])
    packets = ecu.answers("f510")
    assert [len(packet) for packet in packets] == [8, 8, 3]
    assert struct.unpack("<4f", b"".join(p[1:] for p in packets))[0] == pytest.approx(
        ecu.cycle.values["normal_1"]
    )


@pytest.mark.parametrize(
    "address", [0, 0xFFFF_FFFC, ADDRESS["state"] + 64, NUMBERS["geometry.front_length_m"].address - 2]
)
def test_memory_outside_the_areas_is_denied(ecu, address):
    assert ecu.ask(struct.pack("<BBBBI", 0xF4, 4, 0, 0, address)) == refusal(Error.ACCESS_DENIED)
    assert ecu.ask(struct.pack("<BBBBI", 0xF4, 4, 0, 1, ADDRESS["state"])) == refusal(Error.ACCESS_DENIED)


def test_the_checksum_is_the_crc_32_of_the_page(ecu):
    number = NUMBERS["bucket.mass_kg"]
    set_mta(ecu, number.address)
    kind, checksum = struct.unpack("<xBxxI", ecu.ask(struct.pack("<BxxxI", 0xF3, 8)))
    following = calibration_numbers()[calibration_numbers().index(number) + 1]
    expected = struct.pack("<ff", read(ecu, number.address), read(ecu, following.address))
    assert (kind, checksum) == (9, zlib.crc32(expected))


def test_calibration_is_locked_until_the_key_is_given(ecu):
    assert write(ecu, "bucket.mass_kg", 900.0) == refusal(Error.ACCESS_LOCKED)
    assert ecu.ask("e4000000 01".replace(" ", "")) == refusal(Error.ACCESS_LOCKED)
    ecu.unlock()
    assert ecu.ask("fd")[2] == 0
    assert write(ecu, "bucket.mass_kg", 900.0) == b"\xff"


def test_a_wrong_key_ends_the_session(ecu):
    ecu.ask("f80001")
    ecu.ask("f7 10".replace(" ", "") + "00" * 6)
    ecu.ask("f70a" + "00" * 6)
    assert ecu.ask("f704" + "00" * 4) == refusal(Error.ACCESS_LOCKED)
    assert ecu.answers("fd") == []


def test_without_a_secret_no_key_fits(make_ecu):
    ecu = make_ecu(secret=None)
    ecu.ask(CONNECT)
    key = bytes(16)
    ecu.ask("f80001")
    answers = [ecu.answers(bytes((0xF7, len(key) - at)) + key[at : at + 6]) for at in (0, 6, 12)]
    assert answers[-1] == [refusal(Error.ACCESS_LOCKED)]


def test_a_key_serves_once(unlocked):
    assert unlocked.ask("f80001")[1] == 0  # nothing is locked any more: no seed
    unlocked.ask("fe")
    unlocked.ask(CONNECT)
    seed = b"".join(unlocked.ask(bytes((0xF8, mode, 1)))[2:] for mode in (0, 1))
    key = key_of(SECRET, CALIBRATE, seed)
    unlocked.ask("fe")
    unlocked.ask(CONNECT)  # an overheard key in the next session
    answers = [unlocked.answers(bytes((0xF7, len(key) - at)) + key[at : at + 6]) for at in (0, 6, 12)]
    assert answers[-1] == [refusal(Error.ACCESS_LOCKED)]


def test_a_written_value_acts_from_the_next_cycle(unlocked):
    before = payload(unlocked)
    assert write(unlocked, "bucket.mass_kg", 1080.0) == b"\xff"
    assert payload(unlocked) == before
    unlocked.cycles(400)
    # 200 kg more bucket than the file has are 200 kg less payload; the lever arms differ by a few per cent
    assert payload(unlocked) - before == pytest.approx(-200.0, abs=20.0)


def test_what_is_written_between_two_cycles_acts_together(unlocked):
    plain, watched = unlocked.cycle.recalibrate, []
    unlocked.cycle.recalibrate = lambda calibration: (watched.append(calibration), plain(calibration))
    write(unlocked, "front.mass_kg", 2500.0)
    write(unlocked, "limits.creep_speed_kmh", 2.5)
    unlocked.cycles(3)
    assert [(c.parameters.front.mass, c.limits.creep_speed * 3.6) for c in watched] == [
        (2500.0, pytest.approx(2.5))
    ]


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("bucket.mass_kg", -1.0, Error.OUT_OF_RANGE),
        ("bucket.mass_kg", float("nan"), Error.OUT_OF_RANGE),
        ("limits.engage_margin", 0.99, Error.OUT_OF_RANGE),  # above release_margin
        ("cylinders.rod_mm", 400.0, Error.OUT_OF_RANGE),  # thicker than the bore
        ("inputs.stale_cycles", 50.0, Error.WRITE_PROTECTED),
        ("geometry.front_track_m", 1.8, Error.WRITE_PROTECTED),
        ("wheel.unloaded_radius_m", 0.7, Error.WRITE_PROTECTED),
    ],
)
def test_what_the_checks_refuse_changes_nothing(unlocked, name, value, error):
    before = read(unlocked, NUMBERS[name].address)
    calibration = unlocked.cycle.calibration
    assert write(unlocked, name, value) == refusal(error)
    unlocked.cycles(1)
    assert read(unlocked, NUMBERS[name].address) == before
    assert unlocked.cycle.calibration == calibration


def test_the_limit_of_a_range_can_be_written(unlocked):
    assert write(unlocked, "limits.front_torque_kn_m", 50.8) == b"\xff"  # as a float32 above or below 50.8
    assert write(unlocked, "prediction.margin_floor", 0.9) == b"\xff"
    unlocked.cycles(1)
    assert unlocked.cycle.calibration.parameters.prediction.margin_floor == 0.9


def test_half_a_number_does_not_act(unlocked):
    number = NUMBERS["bucket.mass_kg"]
    before = read(unlocked, number.address)
    data = struct.pack("<f", 1000.0)
    set_mta(unlocked, number.address)
    assert unlocked.ask(b"\xf0\x02" + data[:2]) == b"\xff"
    unlocked.cycles(1)
    assert read(unlocked, number.address) == before
    set_mta(unlocked, number.address + 2)
    assert unlocked.ask(b"\xf0\x02" + data[2:]) == b"\xff"
    unlocked.cycles(1)
    assert unlocked.cycle.calibration.parameters.bucket.mass == 1000.0


def test_measurements_cannot_be_written(unlocked):
    set_mta(unlocked, ADDRESS["estimate.normal_1"])
    assert unlocked.ask("f00400000000") == refusal(Error.ACCESS_DENIED)


def test_an_ecu_that_tests_its_sensors_takes_another_mass():
    ecu = Ecu(detect_faults=True)
    ecu.ask(CONNECT)
    ecu.unlock()
    assert write(ecu, "bucket.mass_kg", 900.0) == b"\xff"
    ecu.cycles(1)
    assert ecu.cycle.calibration.parameters.bucket.mass == 900.0


def test_pages_switch_back_and_forth(unlocked):
    number = NUMBERS["bucket.mass_kg"]
    write(unlocked, number.name, 1000.0)
    for page, mass in ((0, 880.0), (1, 1000.0)):
        assert unlocked.ask(bytes((0xEB, 0x83, 0, page))) == b"\xff"
        assert unlocked.ask("ea0100")[3] == unlocked.ask("ea0200")[3] == page
        unlocked.cycles(1)
        assert unlocked.cycle.calibration.parameters.bucket.mass == mass
        assert read(unlocked, number.address) == mass


def test_the_reference_page_is_never_written(unlocked):
    unlocked.ask("eb020000")
    assert write(unlocked, "bucket.mass_kg", 1000.0) == refusal(Error.WRITE_PROTECTED)
    assert unlocked.ask("e400010000") == refusal(Error.WRITE_PROTECTED)


def test_copying_the_reference_page_takes_all_writes_back(unlocked):
    write(unlocked, "bucket.mass_kg", 1000.0)
    assert unlocked.ask("e400000001") == b"\xff"
    unlocked.cycles(1)
    assert unlocked.cycle.calibration.parameters.bucket.mass == 880.0


@pytest.mark.parametrize("how", ["disconnect", "silence"])
def test_the_end_of_a_session_leaves_the_files_calibration(unlocked, how):
    number = NUMBERS["bucket.mass_kg"]
    write(unlocked, number.name, 1000.0)
    unlocked.cycles(1)
    if how == "disconnect":
        assert unlocked.ask("fe") == b"\xff"
        events = unlocked.cycles(1)
    else:
        unlocked.service.before_cycle(unlocked.now_ns + SILENCE_NS + 1)
        events = unlocked.service.after_cycle(unlocked.now_ns)
        assert [frame.data for frame in events] == [b"\xfd\x07"]
    unlocked.cycles(1)
    assert unlocked.cycle.calibration.parameters.bucket.mass == 880.0
    assert unlocked.answers("fd") == []
    unlocked.ask(CONNECT)
    assert read(unlocked, number.address) == 880.0
    assert unlocked.ask("fd")[2] == 1


def test_a_tool_that_only_measures_may_be_silent(ecu):
    ecu.service.before_cycle(ecu.now_ns + 2 * SILENCE_NS)
    assert ecu.ask("fd")[0] == 0xFF


def test_the_estimators_keep_what_they_have_learnt():
    changed, plain = Ecu(), Ecu()
    for ecu in (changed, plain):
        ecu.machine.values |= {
            "wheel_speed_1": 3.0,
            "wheel_speed_2": 3.1,
            "wheel_speed_3": 3.0,
            "wheel_speed_4": 3.1,
        }
        ecu.cycles(100)
    # another object with the same numbers: a restart of the estimators, and no other change
    same = changed.cycle.calibration
    changed.cycle.recalibrate(same)
    for _ in range(50):
        changed.cycles(1)
        plain.cycles(1)
        assert changed.cycle.values == plain.cycle.values


def test_zeros_are_measured_before_the_first_cycle():
    ecu = Ecu()
    assert MeasuredImage(ecu.cycle).bytes() == bytes(MeasuredImage(ecu.cycle).size)
