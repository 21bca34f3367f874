"""The table's state against schedules that are known: periods, ages, what is late, stale and missing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import ERROR, Frame
from dbc import loader_database
from hil.monitor.board import Board, Pace, Row, pace
from tests.hil.monitor.traffic import MS, can_id_of, machine_frames, messages

CYCLE = 10 * MS
ARTICULATION = can_id_of("Articulation")


def row_of(board: Board, name: str, now_ns: int) -> Row:
    return next(row for row in board.rows(now_ns) if row.name == name)


def fed(period_ns: int, count: int = 50, can_id: int = ARTICULATION) -> Board:
    board = Board(messages(senders=["Machine"]))
    for index in range(count):
        board.take("can0", Frame(can_id, bytes(8), index * period_ns))
    return board


@given(st.integers(1, 100 * MS), st.integers(2, 100))
def test_the_period_is_that_of_the_sender(period_ns: int, count: int) -> None:
    board = Board(messages())
    for index in range(count):
        board.take("can0", Frame(0x7FF, b"", index * period_ns))
    (row,) = board.rows((count - 1) * period_ns + 5)
    assert row.period_ns == pytest.approx(period_ns)
    assert (row.age_ns, row.count) == (5, count)


@pytest.mark.parametrize(
    ("age_ns", "expected"),
    [
        (0, Pace.NONE),
        (15 * MS, Pace.NONE),
        (15 * MS + 1, Pace.LATE),
        (30 * MS, Pace.LATE),
        (30 * MS + 1, Pace.STALE),
    ],
)
def test_silence_is_late_from_one_and_a_half_periods_and_stale_from_three(
    age_ns: int, expected: Pace
) -> None:
    last_ns = 49 * CYCLE
    assert row_of(fed(CYCLE), "Articulation", last_ns + age_ns).pace is expected


@pytest.mark.parametrize(
    ("period_ms", "expected"), [(4, Pace.FAST), (6, Pace.NONE), (14, Pace.NONE), (16, Pace.SLOW)]
)
def test_a_steady_wrong_period_is_reported(period_ms: int, expected: Pace) -> None:
    assert pace(CYCLE, period_ms * MS, 0) is expected


def test_a_message_without_cycle_time_is_never_late() -> None:
    assert pace(0, None, 10**15) is Pace.NONE


def test_after_a_gap_the_period_is_measured_anew() -> None:
    board = fed(CYCLE)
    start = 49 * CYCLE + 1_000 * MS
    for index in range(3):
        board.take("can0", Frame(ARTICULATION, bytes(8), start + index * CYCLE))
    assert row_of(board, "Articulation", start + 2 * CYCLE).period_ns == CYCLE


def test_what_a_sender_owes_is_missing_and_what_a_silent_one_owes_is_not() -> None:
    board = Board(messages())
    board.take("can0", Frame(ARTICULATION, bytes(8), 1))
    assert [row.name for row in board.rows(2)] == ["Articulation"]  # too early to say
    rows = {row.name: row for row in board.rows(10**9)}
    machines = {c.name for c in loader_database().by_id.values() if "Machine" in c.senders and c.cycle_ns}
    assert set(rows) == machines
    assert {name for name, row in rows.items() if row.pace is Pace.MISSING} == machines - {"Articulation"}
    assert rows["BodyRates"].age_ns is None


def test_a_machine_at_work_owes_nothing_and_is_in_time() -> None:
    board = Board(messages())
    for frame in machine_frames():
        board.take("can0", frame)
    rows = board.rows(max(frame.at_ns for frame in machine_frames()))
    assert {row.pace for row in rows} == {Pace.NONE}
    for row in rows:
        assert row.period_ns == pytest.approx(row.cycle_ns)


def test_readings_are_of_the_newest_frame() -> None:
    codec = loader_database().by_name["LiftPressure"]
    board = Board(messages())
    for pressure in (100, 2000):
        board.take("can0", Frame(codec.can_id, codec.encode([pressure]), pressure))
    row = row_of(board, "LiftPressure", 3000)
    assert [(field.name, value) for field, value in row.readings] == [("LiftCylinderPressure", 2000)]


def test_buses_identifiers_and_errors_have_rows_of_their_own() -> None:
    board = Board(messages(messages=["Articulation"]))
    for bus in ("can1", "can0"):
        board.take(bus, Frame(ARTICULATION, bytes(8)))
    board.take("can0", Frame(0x7FF, b"\x12\x34"))
    assert [(row.bus, row.name) for row in board.rows(0)] == [
        ("can0", "Articulation"),
        ("can1", "Articulation"),
    ]
    assert board.frames == 3
    board = Board(messages())
    board.take("can0", Frame(0x7FF, b"\x12\x34"))
    board.take("can0", Frame(ERROR | 0x40, bytes(8)))
    assert [(row.name, row.note) for row in board.rows(0)] == [("error frame", "bus off"), ("", "12 34")]


def test_bad_frames_are_counted_with_the_latest_reason() -> None:
    board = Board(messages())
    board.take("can0", Frame(ARTICULATION, b"\1" + bytes(7)))
    board.take("can0", Frame(ARTICULATION, b"\2" + bytes(7)))
    row = row_of(board, "Articulation", 0)
    assert row.findings == 2
    assert "CRC" in row.note
