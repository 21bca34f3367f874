"""candump's lines against what Debian's candump printed (golden/, made by make_golden.py)."""

import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import FD, LOCAL, Frame
from dbc.recordings.logfile import parse_candump
from dbc.recordings.writer import candump_line
from hil.monitor.candump import Candump, Stamp, Style, log_line
from hil.monitor.recordings import rows
from tests.bus.laws import classic, fd, remote
from tests.hil.monitor.candump_tool import STYLES
from tests.hil.monitor.make_golden import file_of

WIDTH_FROM_THE_START = ("any",)  # the name on the command line that the golden files were made with


@pytest.fixture
def utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.fixture(scope="module")
def frames() -> list:
    table = parse_candump(file_of("-L").read_bytes())
    assert len(table) == 60
    assert not table.damaged
    return [(name, frame._replace(flags=frame.flags | LOCAL)) for name, frame in rows(table, 0, len(table))]


@pytest.mark.usefixtures("utc")
@pytest.mark.parametrize("options", STYLES)
def test_lines_are_candumps(options: str, frames: list) -> None:
    candump = Candump(STYLES[options], WIDTH_FROM_THE_START)
    ours = [candump.line(name, frame, frame.at_ns) for name, frame in frames]
    assert ours == file_of(options).read_text(encoding="ascii").splitlines()


def test_a_delta_never_runs_backwards() -> None:
    candump = Candump(Style(stamp=Stamp.DELTA))
    stamps = (2_000_000_000, 1_999_999_000, 3_000_000_000)
    assert [candump.line("can0", Frame(1, b""), at).split()[0] for at in stamps] == [
        "(000.000000)",
        "(000.000000)",
        "(001.000001)",
    ]


def test_the_column_grows_with_longer_names() -> None:
    candump = Candump(Style(), ("can0",))
    lines = [candump.line(name, Frame(1, b""), 0) for name in ("can0", "longer0", "can0")]
    assert [line.index("001") for line in lines] == [8, 11, 11]


@given(classic | remote | fd, st.integers(0, 2**62))
def test_the_log_form_is_what_the_recorder_writes(frame: Frame, wall_ns: int) -> None:
    """Two writers of one format agree, but for the flag that marks CAN FD."""
    ours = log_line("can0", frame, wall_ns)
    theirs = candump_line(frame._replace(at_ns=wall_ns), "can0")
    if frame.flags & FD:
        head, flags, data = ours.rpartition("##")
        ours = f"{head}{flags}{int(data[0], 16) & 3:X}{data[1:]}"
    assert ours == theirs
