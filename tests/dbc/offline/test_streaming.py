"""Tables of a recording do not depend on the pieces in which it is read; the reference for values is cantools."""

import csv
import math
import os
import subprocess
import sys
from pathlib import Path

import cantools
import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.columns import ColumnDecoder
from dbc.database import Database
from dbc.errors import LogError
from dbc.offline import writing
from dbc.offline.decoding import decode_log
from dbc.offline.writing import Tables
from dbc.recordings import blf, logfile, reading
from dbc.tables import Format, TableError

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 1 Plain: 8 A
 SG_ Small : 0|8@1+ (1,0) [0|0] "" A
 SG_ Signed : 12|9@1- (2,-7) [0|0] "m" A
 SG_ Scaled : 31|16@0- (0.25,1) [0|0] "bar" A
 SG_ Half : 47|8@0+ (3,0.5) [0|0] "" A
BO_ 2 Word: 8 A
 SG_ All : 0|64@1+ (1,0) [0|0] "" A
BO_ 3 Signs : 8 A
 SG_ All : 7|64@0- (1,0) [0|0] "" A
BO_ 4 Beyond: 8 A
 SG_ Doubled : 0|64@1- (2,0) [0|0] "" A
BO_ 5 Chosen: 8 A
 SG_ Which M : 0|8@1+ (1,0) [0|0] "" A
 SG_ Wide m1 : 8|56@1+ (1,0) [0|0] "" A
 SG_ Narrow m2 : 8|16@1- (1,0) [0|0] "" A
 SG_ Real m3 : 8|32@1- (1,0) [0|0] "" A
BO_ 6 Real: 8 A
 SG_ Single : 0|32@1- (1,0) [0|0] "" A
 SG_ Factor : 32|32@1- (0.5,0) [0|0] "" A
BO_ 7 Long: 20 A
 SG_ Crossing : 60|20@1- (1,0) [0|0] "" A
 SG_ Motorola : 7|52@0+ (0.001,0) [0|0] "" A
 SG_ Great : 80|72@1+ (1,0) [0|0] "" A
SIG_VALTYPE_ 5 Real : 1;
SIG_VALTYPE_ 6 Single : 1;
SIG_VALTYPE_ 6 Factor : 1;
"""
MULTIPLEXED = 5


@pytest.fixture(scope="module")
def dbc(tmp_path_factory):
    file = tmp_path_factory.mktemp("dbc") / "every.dbc"
    file.write_text(DBC)
    return Database.from_file(file)


@st.composite
def lines(draw):
    """Lines of a log: every message, short frames, a second channel, a stranger, damage."""
    made = []
    for number in range(draw(st.integers(1, 40))):
        kind, channel = draw(st.integers(1, 9)), draw(st.sampled_from(["can0", "can0", "can0", "can1"]))
        if kind == 9:
            made.append("rubbish")
            continue
        whole = 20 if kind == 7 else 8
        data = bytearray(draw(st.binary(min_size=whole, max_size=whole)))
        if kind == MULTIPLEXED:
            data[0] = draw(st.integers(0, 4))
        shown = data[: draw(st.integers(0, whole))] if draw(st.integers(0, 9)) == 0 else data
        made.append(f"({number}.{number:06d}) {channel} {kind:03X}#{'#0' if kind == 7 else ''}{shown.hex()}")
    return made


def decoded(dbc, log, out, form, *, piece, buffered=1 << 20):
    """The tables, and what was counted; text is read and parsed `piece` bytes at a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logfile, "PIECE", piece)
        patch.setattr(writing, "BUFFERED", buffered)
        with Tables(out, log, form, several=False, j1939=True) as tables:
            done = decode_log(log, ColumnDecoder(dbc), take=tables.take)
            tables.finish()
    return done


def content(out, form):
    if form is Format.CSV:
        return {file.name: file.read_bytes() for file in out.iterdir()}
    return {
        file.name: (table.schema.to_string(show_field_metadata=True), repr(table.to_pydict()))
        for file in out.iterdir()
        for table in [pq.read_table(file)]
    }


@pytest.mark.parametrize("form", Format)
@given(made=lines(), piece=st.integers(1, 300), buffered=st.sampled_from([0, 500, 5000]))
@settings(deadline=None, max_examples=60)
def test_tables_do_not_depend_on_the_pieces(tmp_path_factory, dbc, form, made, piece, buffered):
    folder = tmp_path_factory.mktemp("pieces")
    log = folder / "drive.log"
    log.write_text("(0.000000) can0 008#\n" + "".join(f"{line}\n" for line in made))
    whole = decoded(dbc, log, folder / "whole", form, piece=1 << 20)
    pieces = decoded(dbc, log, folder / "pieces", form, piece=piece, buffered=buffered)
    assert pieces == whole
    if whole.messages:
        assert content(folder / "pieces", form) == content(folder / "whole", form)
    assert whole.damaged_count == made.count("rubbish")
    assert [d.at for d in pieces.damaged] == [k for k, line in enumerate(made, 2) if line == "rubbish"]


@given(made=lines())
@settings(deadline=None, max_examples=60)
def test_tables_hold_cantools_values(tmp_path_factory, dbc, made):
    """Both formats against cantools, frame by frame, with the types that the DBC decides."""
    folder = tmp_path_factory.mktemp("values")
    log = folder / "drive.log"
    log.write_text("(0.000000) can0 008#\n" + "".join(f"{line}\n" for line in made))
    decoded(dbc, log, folder / "csv", Format.CSV, piece=200, buffered=500)
    decoded(dbc, log, folder / "parquet", Format.PARQUET, piece=200, buffered=500)
    reference = cantools.database.load_file(dbc.source)
    expected = {}
    for line in made:
        if line == "rubbish" or line.split(" ")[2].startswith("008"):
            continue
        number, data = line.split(" ")[2].replace("##0", "#").split("#")
        message = reference.get_message_by_frame_id(int(number, 16))
        if len(data) == 2 * message.length or int(number) != MULTIPLEXED:
            known = {}
            if int(number) != MULTIPLEXED or int(data[:2], 16) in (1, 2, 3):
                known = message.decode(bytes.fromhex(data), decode_choices=False, allow_truncated=True)
            elif data:
                known = {"Which": int(data[:2], 16)}
            expected.setdefault(message.name, []).append(known)
    for name, theirs in expected.items():
        with (folder / "csv" / f"{name}.csv").open() as stream:
            read = list(csv.DictReader(stream))
        table = pq.read_table(folder / "parquet" / f"{name}.parquet")
        assert len(read) == table.num_rows == len(theirs)
        for ours, packed, values in zip(read, table.to_pylist(), theirs, strict=True):
            for header, text in ours.items():
                signal = header.split(" [")[0]
                if signal in ("time_s", "channel", "source_address"):
                    continue
                value = values.get(signal)
                if value is None or value != value:
                    assert text == "nan"
                    assert packed[signal] is None or math.isnan(packed[signal])
                else:
                    assert (int(text) if isinstance(value, int) and "." not in text else float(text)) == value
                    # what has more than 64 bits is a float in Parquet
                    assert packed[signal] == (float(value) if isinstance(packed[signal], float) else value)


def test_a_column_has_the_type_that_the_dbc_says_whatever_the_frames(tmp_path, dbc):
    types = {}
    for name, shown in (("whole", 16), ("short", 2)):
        log = tmp_path / f"{name}.log"
        log.write_text(
            f"(1.000000) can0 001#{'0123456789ABCDEF'[:shown]}\n(2.000000) can0 001#0123456789ABCDEF\n"
        )
        decoded(dbc, log, tmp_path / name, Format.PARQUET, piece=30)
        table = pq.read_table(tmp_path / name / "Plain.parquet")
        types[name] = table.schema.types
    assert types["short"] == types["whole"]
    assert [str(kind) for kind in types["whole"]] == ["double", "int64", "int64", "int64", "double", "double"]
    assert table["Signed"].to_pylist()[0] is None


def test_a_channel_that_comes_late_is_in_every_row(tmp_path, dbc):
    log = tmp_path / "late.log"
    log.write_text(
        "".join(f"({k}.000000) can0 00{1 + k % 2}#{k:016X}\n" for k in range(50))
        + "(60.000000) weird,name 001#0000000000000000\n"
    )
    for form in Format:
        decoded(dbc, log, tmp_path / form, form, piece=60, buffered=0)
    with (tmp_path / "csv" / "Plain.csv").open() as stream:
        named = [row["channel"] for row in csv.DictReader(stream)]
    assert named == ["can0"] * 25 + ["weird,name"]
    table = pq.read_table(tmp_path / "parquet" / "Plain.parquet")
    assert table["channel"].to_pylist() == named
    assert table.schema.names[:3] == ["time_s", "channel", "source_address"]
    assert pq.read_table(tmp_path / "parquet" / "Word.parquet")["channel"].to_pylist() == ["can0"] * 25


@pytest.mark.parametrize("form", Format)
def test_what_breaks_off_leaves_no_file(tmp_path, dbc, form):
    """Ctrl-C in the middle, and a channel that turns out to be missing."""
    log = tmp_path / "drive.log"
    log.write_text("".join(f"({k}.000000) can0 001#{k:016X}\n" for k in range(200)))
    out = tmp_path / "out"
    decoder = ColumnDecoder(dbc)

    def interrupted(read, total):
        if read > total / 2:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logfile, "PIECE", 100)
        patch.setattr(writing, "BUFFERED", 0)
        with pytest.raises(KeyboardInterrupt), Tables(out, log, form, several=False, j1939=False) as tables:
            decode_log(log, decoder, interrupted, take=tables.take)
    assert list(out.iterdir()) == []
    with pytest.raises(LogError, match="no channel 'can9'; there are can0"):
        decode_log(log, decoder, channel="can9")


@pytest.mark.parametrize("form", Format)
def test_a_full_disk_is_one_line_that_names_the_file(tmp_path, dbc, form, monkeypatch):
    log = tmp_path / "drive.log"
    log.write_text("".join(f"({k}.000000) can0 001#{k:016X}\n" for k in range(200)))
    out = tmp_path / "out"
    # /dev/full answers every write as a full disk does
    opened = Path.open

    def full(path, mode="r", **how):
        return opened(Path("/dev/full") if mode == "a" or mode == "ab" else path, mode, **how)

    monkeypatch.setattr(Path, "open", full)

    def decoded_to_a_full_disk():
        with Tables(out, log, form, several=False, j1939=False) as tables:
            decode_log(log, ColumnDecoder(dbc), take=tables.take)
            tables.finish()

    with pytest.raises(
        TableError, match=f"Plain.{form}: cannot be written: No space left on device"
    ) as error:
        decoded_to_a_full_disk()
    assert "\n" not in str(error.value)
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("form", ["blf", "asc"])
def test_pieces_of_other_formats_join_to_the_whole(tmp_path, form):
    import can

    file = tmp_path / f"a.{form}"
    with can.Logger(file) as logger:
        for k in range(300):
            logger(
                can.Message(
                    timestamp=1.6e9 + k,
                    arbitration_id=k,
                    data=k.to_bytes(8, "big"),
                    channel=k % 3,
                    is_fd=k > 200,
                )
            )
    whole = list(reading.read_frames(file).frames())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reading, "PIECE_FRAMES", 7)
        patch.setattr(blf, "PIECE_FRAMES", 7)
        pieces = list(reading.read_pieces(file))
    assert len(whole) == 300
    assert len(pieces) > 2
    assert [frame for piece in pieces for frame in piece.frames()] == whole
    named = [piece.channels[c] for piece in pieces for c in piece.channel]
    assert named == [f"can{k % 3}" for k in range(300)]


MEASURED = """
import sys
from pathlib import Path
from dbc import loader_database
from dbc.columns import ColumnDecoder
from dbc.offline.decoding import decode_log
from dbc.offline.writing import Tables
from dbc.tables import Format
log, out = map(Path, sys.argv[1:])
with Tables(out, log, Format.PARQUET, several=False, j1939=False) as tables:
    done = decode_log(log, ColumnDecoder(loader_database()), take=tables.take)
    tables.finish()
# not getrusage: a new process inherits there what its parent had
[peak] = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")]
print(done.frames, int(peak) / 1024)
"""


def test_twenty_times_the_log_needs_no_more_memory(tmp_path):
    """2.4 million frames against 120 000, in a process of its own: the whole table would take some 400 MiB more."""
    from bench.bench_decode import make_log

    short, long = tmp_path / "short.log", tmp_path / "long.log"
    make_log(short, 120_000)
    with long.open("wb") as out:
        for _ in range(20):
            out.write(short.read_bytes())
    peak = {}
    for log in (short, long):
        command = [sys.executable, "-c", MEASURED, str(log), str(tmp_path / log.stem)]
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
        found = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        frames, mib = found.split()
        peak[int(frames)] = float(mib)
    assert list(peak) == [120_000, 2_400_000]
    assert peak[2_400_000] < 400, peak
    rows = sum(pq.read_metadata(file).num_rows for file in (tmp_path / "long").iterdir())
    assert rows == 2_400_000
    times = pq.read_table(tmp_path / "long" / "Articulation.parquet")["time_s"].to_numpy()
    assert np.count_nonzero(np.diff(times) < 0) == 19
