"""No mutated file raises anything but the reader's own error, takes 10 s, or a gigabyte; no frame ends a receiver."""

import os
import random
import time
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests.deploy.c.building import compiler
from tests.fuzz import long
from tests.fuzz.frames import RECEIVERS, through_ecu, through_services
from tests.fuzz.mutate import mutated
from tests.fuzz.outcome import Outcome, carried_out
from tests.fuzz.readers import READERS, MutatedFiles

FEW = {"mf4": 10, "run folder": 30, "machine": 30, "calibration": 30}
"""The slower readers; `make fuzz` reads 10^5 files."""


@pytest.mark.parametrize("name", READERS)
def test_mutated_files_end_in_one_line_or_are_read(name, tmp_path):
    outcome = carried_out(MutatedFiles(name, tmp_path), 0, FEW.get(name, 60))
    assert outcome.defects == []
    assert outcome.units == FEW.get(name, 60)


@pytest.mark.parametrize("name", RECEIVERS)
def test_random_and_mutated_frames_end_no_receiver(name, tmp_path):
    if "C" in name.split():
        compiler()
    warm = {
        "frames to the ECU": through_ecu,
        "frames to XCP and UDS": through_services,
    }  # without its warm-up, which compiles all forms
    with nullcontext(warm[name]) if name in warm else RECEIVERS[name](tmp_path) as case:
        for number in range(2):
            # an exception fails here as well; what is compiled on first use takes no case's time
            case(number)
        outcome = carried_out(case, 0, 2)
    assert outcome.defects == []
    assert outcome.units > 1500


def found():
    """Files that once broke a reader, named READER--WHY.SUFFIX."""
    return sorted(Path(__file__).with_name("found").iterdir())


@pytest.mark.parametrize("file", found(), ids=lambda file: file.stem)
def test_what_broke_a_reader_once_is_read_or_refused_in_one_line(file):
    by_name = {name.replace(", ", "-").replace(" ", "-"): reader for name, reader in READERS.items()}
    reader = by_name[file.name.split("--")[0]]
    try:
        reader.read(file)
    except reader.permitted as error:
        assert "\n" not in str(error).strip()  # noqa: PT017 - a file that is read is as good


def test_a_number_always_gives_the_same_mutation():
    first, again = (mutated(b"seed of a file", [b"another"], random.Random("x/3")) for _ in range(2))
    assert first == again
    assert first != b"seed of a file"


def broken(number):
    """A target with one case of every defect."""
    match number:
        case 2:
            raise RuntimeError("a bug")
        case 4:
            os.kill(os.getpid(), 9)
        case 6:
            bytearray(3 << 30)
        case 8:
            time.sleep(1000)
    return 1, 1


def test_every_kind_of_defect_is_found_and_the_rest_carried_out(monkeypatch):
    monkeypatch.setattr(long, "LONGEST_S", 0.5)
    monkeypatch.setattr(
        long.multiprocessing, "get_context", lambda _: long.multiprocessing.context.ForkContext()
    )
    monkeypatch.setattr(long, "case_of", lambda *_: nullcontext(broken))
    outcome = long.block("broken", 0, 12)
    assert [number for number, _ in outcome.defects] == [2, 4, 6, 8]
    whats = [what for _, what in outcome.defects]
    assert whats[0] == "RuntimeError: a bug"
    assert "-9" in whats[1]
    assert whats[2].startswith("MemoryError")
    assert "was ended after" in whats[3]
    assert outcome.units == 12


def test_a_run_goes_on_where_it_ended_and_never_mixes_versions(tmp_path):
    file = tmp_path / "new" / "state.json"
    long.State(file, "abc").add("blf", Outcome(5, 2, defects=[(3, "x")]), 5)
    again = long.State.taken_up(file, "abc")
    assert again.cases == {"blf": 5}
    assert again.done["blf"] == Outcome(5, 2, defects=[(3, "x")])
    assert long.State.taken_up(file, "abd").done == {}
