"""The table on terminals of every size: nothing overflows, what matters is there, colours are optional."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from bus.frame import Frame
from dbc import loader_database
from hil.monitor.board import Board, Row
from hil.monitor.live import LiveView, TableView
from hil.monitor.source import Batch
from hil.monitor.table import Head, render
from tests.hil.monitor.traffic import MS, can_id_of, machine_frames, messages

LAST_NS = max(frame.at_ns for frame in machine_frames())


class StillSource:
    """A source whose clock stands."""

    names = ("loader",)

    def __init__(self, now_ns: int, lost: int = 0) -> None:
        self._now_ns, self._lost = now_ns, lost

    def now_ns(self) -> int:
        return self._now_ns

    def lost(self) -> dict[str, int]:
        return {"loader": self._lost}


def rows(now_ns: int = LAST_NS) -> list[Row]:
    board = Board(messages())
    for frame in machine_frames():
        board.take("loader", frame)
    return board.rows(now_ns)


def drawn(width: int, height: int | None, shown: list[Row], **console: object) -> list[str]:
    """The lines of the table as a console without colours shows them."""
    terminal = Console(width=width, height=height or 1000, highlight=False, color_system=None, **console)
    head = Head(source="loader", frames=1000, elapsed_s=1.0, lost={"loader": 0})
    with terminal.capture() as captured:
        terminal.print(render(head, shown, width=width, height=height), no_wrap=True, crop=True)
    return captured.get().splitlines()


@settings(max_examples=40, deadline=None)
@given(st.integers(60, 220), st.integers(5, 80))
def test_it_fits_any_terminal(width: int, height: int) -> None:
    lines = drawn(width, height, rows())
    assert len(lines) <= height
    assert max(map(len, lines)) <= width


def test_80_by_24_shows_every_message_of_the_machine_with_a_value() -> None:
    shown = rows()
    lines = drawn(80, 24, shown)
    text = "\n".join(lines)
    assert "more" not in text
    for row in shown:
        (line,) = [line for line in lines if line.startswith(f"{row.name} ")]
        assert row.identifier in line
        assert f"/{row.cycle_ns / 1e6:g} " in line
        field, value = row.readings[0]
        assert f" {field.text(value)}" in line
    assert lines[0] == "loader  1000 frames, 1000/s, 1.0 s"
    assert lines[1].split() == ["message", "id", "ms/cycle", "age", "s", "signals"]


def test_what_does_not_fit_is_counted() -> None:
    shown = rows()
    lines = drawn(80, 10, shown)
    assert len(lines) == 10
    assert lines[-1].startswith(f"and {len(shown) - 7} more; narrow it down")


def test_with_room_every_signal_is_shown() -> None:
    shown = rows()
    text = "\n".join(drawn(120, None, shown))
    for row in shown:
        for field, value in row.readings:
            assert re.search(rf"\b{field.name} {re.escape(field.text(value))}", text)
    assert "…" not in text


def test_the_name_of_a_signal_is_shortened_before_its_value() -> None:
    (line,) = [line for line in drawn(70, 24, rows()) if line.startswith("VehicleSpeed ")]
    assert re.search(r"Wheel\w*… 0\.000 km/h", line)


@pytest.mark.parametrize(
    ("now_ns", "word", "colour"), [(LAST_NS + 18 * MS, "late", 33), (LAST_NS + 10**9, "stale", 31)]
)
def test_what_is_late_is_coloured_and_named(now_ns: int, word: str, colour: int) -> None:
    late = [row for row in rows(now_ns) if row.name == "Articulation"]
    assert f" {word} " in drawn(80, 24, late)[2]
    terminal = Console(width=80, height=24, force_terminal=True, color_system="standard", highlight=False)
    with terminal.capture() as captured:
        terminal.print(render(Head(source="x", frames=0, elapsed_s=0), late, width=80, height=24))
    assert f"\33[{colour}m{word}" in captured.get().splitlines()[2].replace("\33[0m", "")


def test_several_buses_have_a_column() -> None:
    board = Board(messages(messages=["Articulation"]))
    for bus in ("can0", "can1"):
        board.take(bus, Frame(can_id_of("Articulation"), bytes(8)))
    lines = drawn(80, 24, board.rows(0))
    assert lines[1].startswith("bus ")
    assert [line.split()[:2] for line in lines[2:] if line[0] != " "] == [
        ["can0", "Articulation"],
        ["can1", "Articulation"],
    ]


def test_losses_stand_in_the_headline() -> None:
    console = Console(width=100, height=24, color_system=None)
    view = TableView(messages(), StillSource(LAST_NS, lost=7), "loader", console)  # type: ignore[arg-type]
    assert view.text(Batch([("loader", frame) for frame in machine_frames()], 0)) == ""
    lines = view.end().splitlines()
    assert lines[0].endswith("fell behind, lost: loader 7")
    assert not any(line != line.rstrip() for line in lines)


def test_the_live_table_draws_in_place_and_leaves_the_terminal_as_it_was() -> None:
    console = Console(width=80, height=24, force_terminal=True, color_system=None, highlight=False)
    view = LiveView(messages(), StillSource(LAST_NS), "loader", console)  # type: ignore[arg-type]
    first = view.text(Batch([("loader", frame) for frame in machine_frames()], 0))
    assert first.startswith("\33[?1049h\33[?25l\33[H")
    assert first.count("\r\n") <= 23
    assert not first.endswith("\n")  # a line end in the last line would scroll
    assert view.text(Batch([], 0)) == ""  # not more often than people can see
    last = view.end()
    assert last.startswith("\33[?25h\33[?1049l")
    assert "Articulation " in last


def uncertain(**raw: int) -> Board:
    """A board that has heard the loads, and once their standard deviations with these raw values."""
    board, database = Board(messages()), loader_database()
    loads, sent = database.by_name["NormalForces"], database.by_name["EstimateUncertainty"]
    values = {s.name: (raw.get(s.name, s.not_available) or 0) * s.scale for s in sent.layout}
    board.take("can0", Frame(loads.can_id, loads.encode_dict(dict.fromkeys(loads.signals, 1)), 1))
    board.take("can0", Frame(sent.can_id, sent.encode_dict(values), 2))
    return board


def test_a_standard_deviation_stands_beside_its_estimate() -> None:
    """30 steps of 0.05 kN; none where it is not available, and none that is stale."""
    board = uncertain(NormalForceFrontLeft=30)
    (line,) = [text for text in drawn(220, None, board.rows(3)) if text.startswith("NormalForces")]
    assert "FrontLeft 1.00 kN ± 1.50 kN" in line
    assert "FrontRight 1.00 kN  " in line
    later = [text for text in drawn(220, None, board.rows(400 * MS)) if text.startswith("NormalForces")]
    assert "±" not in later[0]
