"""A DBC that was read before is the same without cantools; what cannot be trusted is read anew."""

from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import dbc.definitions.kept
from dbc import FOLDER
from dbc.database import Database
from dbc.definitions.definition import Definition
from dbc.definitions.kept import MOST_FILES, keep, recall
from dbc.definitions.limits import read_text
from dbc.definitions.parsing import parse
from dbc.errors import DatabaseError

ROOT = Path(__file__).resolve().parents[3]
ENGINE = ROOT / "examples/engine/engine.dbc"
EVERYTHING = """VERSION ""
BU_: Sender Receiver Other
BO_ 291 Paged: 8 Sender
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Receiver,Other
 SG_ Speed m0 : 8|16@1- (0.1,-5) [-0|1e20] "km/h" Receiver
 SG_ Angle m1 : 15|16@0- (2.0,0) [0|0] "°" Receiver

BO_ 2566844672 Extended: 8 Sender
 SG_ Outer M : 0|8@1+ (1,0) [0|0] "" Receiver
 SG_ Inner m2M : 8|8@1+ (1,0) [0|0] "" Receiver
 SG_ Deep m5 : 16|32@1+ (1,0) [0|0] "" Receiver

BO_ 292 Floats: 12 Sender
 SG_ Single : 0|32@1- (1,0) [0|0] "" Receiver
 SG_ Double : 39|64@0- (2,0.5) [-1.5|0.1] "" Receiver

CM_ BO_ 292 "two of them";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "E2EProfile" ENUM "none","P01";
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_ BO_ "InputLossState" STRING ;
BA_DEF_ BO_ "InputTimeout" INT 0 65535;
BA_DEF_ BU_ "StateSignal" STRING ;
BA_DEF_ BU_ "StateRunning" STRING ;
BA_DEF_DEF_ "E2EProfile" "none";
BA_ "GenMsgCycleTime" BO_ 291 20;
BA_ "E2EProfile" BO_ 291 1;
BA_ "E2EDataId" BO_ 291 4660;
BA_ "InputLossState" BO_ 291 "limp";
BA_ "InputTimeout" BO_ 291 100;
BA_ "StateSignal" BU_ Sender "Paged.Page";
BA_ "StateRunning" BU_ Sender "first";
VAL_ 291 Page 0 "first" 1 "second" ;
SIG_VALTYPE_ 292 Single : 1;
SIG_VALTYPE_ 292 Double : 2;
SG_MUL_VAL_ 2566844672 Inner Outer 2-2;
SG_MUL_VAL_ 2566844672 Deep Inner 5-7, 9-9;
"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """The folder where definitions are kept during the test."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
    return folder


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "everything.dbc"
    path.write_text(EVERYTHING, encoding="cp1252")
    return path


def kept_files(cache):
    return sorted(cache.glob("definitions-*/*"))


def refuse(*_, **__):
    raise AssertionError("the DBC is read again")


def alike(first, second):
    """Equal, and of the same types throughout: 1 and 1.0 decode to other types, minus zero to another number."""
    if type(first) is not type(second):
        return False
    if is_dataclass(first):
        return all(alike(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))
    if isinstance(first, dict):
        return list(first) == list(second) and all(map(alike, first.values(), second.values()))
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(alike, first, second))
    return first == second if isinstance(first, frozenset) else repr(first) == repr(second)


def assert_kept_alike(file):
    text = read_text(file)
    read = parse(file, text, strict=False)
    assert read.messages
    keep(text, read, strict=False)
    again = recall(text, strict=False)
    assert again is not None
    assert alike(again, read)


@pytest.mark.parametrize("name", ["loader.dbc", "reference.dbc", "j1939.dbc", str(ENGINE)])
def test_what_is_kept_of_our_files_is_what_was_read(name):
    assert_kept_alike(FOLDER / name)


def test_what_is_kept_of_every_field_is_what_was_read(file):
    assert_kept_alike(file)


@pytest.mark.data
def test_what_is_kept_of_a_foreign_database_is_what_was_read(recordings):
    assert_kept_alike(recordings / "comma2k19_rav4" / "_toyota_2017.dbc")


def test_the_second_reading_needs_no_parser_and_gives_the_same_frames(file, monkeypatch):
    first = Database.from_file(file)
    monkeypatch.setattr("dbc.database.parse", refuse)
    second = Database.from_file(file)
    assert second.nodes == first.nodes
    for name, codec in first.by_name.items():
        other = second.by_name[name]
        frame = bytes([2, 5, *range(codec.length - 2)]) if name == "Extended" else bytes(codec.length)
        assert repr(other.decode_dict(frame)) == repr(codec.decode_dict(frame))
    assert second.by_name["Paged"].protection.protect(bytes(8), 3) == first.by_name[
        "Paged"
    ].protection.protect(bytes(8), 3)
    assert second.by_name["Paged"].conduct.state == "limp"


@pytest.mark.parametrize(
    "damage",
    [
        lambda kept: b"",
        lambda kept: kept[:-10],
        lambda kept: kept.replace(b'"length":8', b'"length":7', 1),
        lambda kept: b'{"messages":[],"nodes":{}}',
        lambda kept: kept.partition(b"\n")[0] + b'\n{"messages":[],"nodes":{}}',
    ],
    ids=["empty", "cut", "changed", "without a checksum", "under the checksum of another"],
)
def test_what_is_damaged_is_read_anew_and_kept_again(file, cache, damage):
    Database.from_file(file)
    [kept] = kept_files(cache)
    good = kept.read_bytes()
    assert damage(good) != good
    kept.write_bytes(damage(good))
    assert recall(read_text(file), strict=True) is None
    assert Database.from_file(file).by_name["Paged"].length == 8
    assert kept.read_bytes() == good


def test_a_right_checksum_before_something_else_counts_as_nothing(file, cache):
    Database.from_file(file)
    [kept] = kept_files(cache)
    for body in (b"[]", b"{}", b'{"messages":[{}],"nodes":{}}', b"\xff"):
        kept.write_bytes(dbc.definitions.kept._checksum(body) + b"\n" + body)
        assert recall(read_text(file), strict=True) is None


def test_a_changed_factor_is_another_file(file):
    Database.from_file(file)
    file.write_text(EVERYTHING.replace("(0.1,-5)", "(0.2,-5)"), encoding="cp1252")
    assert Database.from_file(file).by_name["Paged"].by_signal["Speed"].scale == 0.2


def test_a_changed_reader_reads_anew(file, monkeypatch):
    Database.from_file(file)
    monkeypatch.setattr("dbc.definitions.kept._reader", lambda: "another state of the sources")
    assert recall(read_text(file), strict=True) is None


def test_what_a_lenient_reading_kept_is_still_refused_by_a_strict_one(tmp_path):
    file = tmp_path / "overlapping.dbc"
    file.write_text(EVERYTHING.replace("39|64@0-", "0|64@1-"), encoding="cp1252")
    assert Database.from_file(file, strict=False).by_name
    with pytest.raises(DatabaseError, match="not a usable DBC"):
        Database.from_file(file)


@pytest.mark.parametrize(
    "damaged",
    [
        EVERYTHING.replace("SG_ Page M : 0|8", "SG_ Page M : 0"),
        EVERYTHING.replace('"P01"', '"P02"'),
        EVERYTHING.replace("BO_ 291 Paged: 8", "BO_ 291 Paged: 5000"),
    ],
    ids=["no DBC", "unknown protection", "too long"],
)
def test_a_damaged_dbc_has_the_same_error_every_time(tmp_path, cache, damaged):
    file = tmp_path / "damaged.dbc"
    file.write_text(damaged, encoding="cp1252")
    said = []
    for _ in range(2):
        with pytest.raises(DatabaseError) as error:
            Database.from_file(file)
        said.append(str(error.value))
    assert said[0] == said[1]
    assert not kept_files(cache)


def test_without_a_place_to_keep_it_the_dbc_is_read_all_the_same(file, tmp_path, monkeypatch):
    nowhere = tmp_path / "a file"
    nowhere.touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(nowhere))
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere))
    monkeypatch.setattr("dbc.definitions.kept.FOLDER", nowhere)
    dbc.definitions.kept._reader.cache_clear()
    try:
        assert Database.from_file(file).by_name["Paged"].length == 8
    finally:
        dbc.definitions.kept._reader.cache_clear()


def test_only_the_newest_are_kept(cache):
    for number in range(MOST_FILES + 5):
        keep(b"%d" % number, Definition(()), strict=True)
    assert len(kept_files(cache)) == MOST_FILES
    assert recall(b"%d" % (MOST_FILES + 4), strict=True) == Definition(())
