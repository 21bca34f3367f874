"""`loaderhil diagnose --model loader` on recordings that are not what they should be: each has a clear verdict.

Run directories as the bench leaves them, and tables of the same channels. The library is cut to one effect of a sensor and
nothing open-ended is looked for, so that a search takes seconds; what is asked of the input does not depend on it.
"""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.reading.csv_writer import csv_text
from discrepancy.examine import investigate
from discrepancy.models.loader import model as loader
from discrepancy.signals.recording import Recording, Signal
from hil.compose import Choice
from hil.runs import run_lockstep
from plant.sheets.machine import load_machine
from tests.diagnosis.cases import Call, loaderhil

__all__ = ["loaderhil"]

DRIVE = """
name = "drive"
sentence = "Speeds up in a zigzag."
duration_s = 9.0
machine = "l60"
seed = 1
[start]
speed_kmh = 8.0
[driver.speed_kmh]
points = [[0.0, 8.0], [3.0, 12.0], [9.0, 6.0]]
[driver.articulation_deg]
points = [[0.3, 0.0], [1.5, 15.0], [3.5, -12.0], [6.0, 10.0], [6.8, 10.0], [8.5, -5.0]]
"""
KEPT = ("yaw_rate", "roll_rate", "specific_force_x", "specific_force_y", "specific_force_z", *loader.SPEEDS)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.toml").write_text(DRIVE)
    run_lockstep(Choice(scenario=str(folder / "drive.toml")), folder / "run")
    return folder / "run"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = loader.model

    def short(recordings=(), **chosen):  # type: ignore[no-untyped-def]
        model = whole(recordings, **chosen)
        return replace(model, effects=tuple(e for e in model.effects if e.name == "yaw_rate scale"))

    def without_equations(model, recordings, settings, *rest):  # type: ignore[no-untyped-def]
        return investigate(model, recordings, replace(settings, open_ended=False), *rest)

    monkeypatch.setattr(loader, "model", short)
    monkeypatch.setattr("diagnosis.question.investigate", without_equations)


def cut(folder: Path) -> None:
    """Half of the bytes, and a line that is none."""
    data = (folder / "bus.log").read_bytes()
    (folder / "bus.log").write_bytes(
        data[: len(data) // 3] + b"\n(0.1) garbage\n" + data[len(data) // 3 : len(data) // 2]
    )
    (folder / "reference.log").unlink()


def _without(folder: Path, key: str) -> None:
    """run.json that lacks a key."""
    fields = json.loads((folder / "run.json").read_text())
    del fields[key]
    (folder / "run.json").write_text(json.dumps(fields))


RUNS: dict[str, tuple[Callable[[Path], object], int, str]] = {
    "no log": (lambda d: (d / "bus.log").unlink(), 5, "loader reads a run directory"),
    "empty log": (lambda d: (d / "bus.log").write_text(""), 5, "the recording is empty"),
    "junk": (lambda d: (d / "bus.log").write_bytes(bytes(range(256)) * 40), 5, "not a candump log"),
    "another bus": (lambda d: shutil.copy(d / "reference.log", d / "bus.log"), 5, "belongs to this bus; is it the log of another bus?"),
    "record cut off": (lambda d: (d / "run.json").write_text('{"payl'), 5, "cannot be read as the record of a run"),
    "record without a machine": (lambda d: _without(d, "machine"), 5, "run.json: machine: Field required"),
    "empty reference": (lambda d: (d / "reference.log").write_text(""), 0, "reference.log: the recording is empty"),
    "another's reference": (lambda d: shutil.copy(d / "bus.log", d / "reference.log"), 0, "reference.log: none of its"),
    "cut off": (cut, 0, "damaged places, skipped; the first"),
}  # fmt: skip


@pytest.mark.parametrize("kind", RUNS)
def test_run_directories(kind: str, run: Path, tmp_path: Path, loaderhil: Call) -> None:
    change, code, said = RUNS[kind]
    folder = tmp_path / "copy"
    shutil.copytree(run, folder)
    change(folder)
    ended = loaderhil("diagnose", folder, "--model", "loader")
    assert ended.code == code, ended.out + ended.err
    assert ended.result is not None
    assert said in " ".join([*ended.result.reasons, *(c.text for c in ended.result.complaints)])


@pytest.fixture(scope="module")
def compact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same drive with the smaller machine."""
    folder = tmp_path_factory.mktemp("compact")
    (folder / "drive.toml").write_text(DRIVE.replace("l60", "compact"))
    run_lockstep(Choice(scenario=str(folder / "drive.toml")), folder / "small")
    return folder / "small"


def test_a_run_is_judged_as_one_of_the_machine_that_it_was_made_with(
    compact: Path, tmp_path: Path, loaderhil: Call
) -> None:
    ended = loaderhil("diagnose", compact, "--model", "loader", "--apply", tmp_path / "mine.toml")
    assert ended.code == 0, ended.out + ended.err
    assert ended.result is not None
    assert ended.result.status == "nothing missing"
    assert ended.out.startswith("baseline: machine compact, as run.json of small says\n")
    assert load_machine(tmp_path / "mine.toml") == load_machine("compact")


def test_machines_that_do_not_go_together_are_refused_in_one_line(
    run: Path, compact: Path, loaderhil: Call
) -> None:
    for words, said in (
        ((compact, "--with", "l60"), "run.json of small says machine compact (family compact), the baseline is l60 (family l60)"),
        ((run, compact), "run.json of run says machine l60, that of small compact: diagnose them separately, or with --each"),
    ):  # fmt: skip
        ended = loaderhil("diagnose", *words, "--model", "loader")
        assert (ended.code, ended.result) == (2, None)
        assert said in ended.err.splitlines()[-1]
    ended = loaderhil("diagnose", compact, "--model", "printed-estimator")
    assert ended.code == 2
    assert "the baseline is l60 (family l60): printed-estimator judges" in ended.err.splitlines()[-1]


@pytest.fixture(scope="module")
def drive(run: Path) -> Recording:
    whole = loader.load_run(run)
    names = {*loader.INPUTS, *loader.OPTIONAL, *KEPT} & set(whole.signals)
    return replace(whole, signals={n: s for n, s in whole.signals.items() if n in names})


def scaled(factor: float) -> Callable[[Signal], Signal]:
    return lambda s: replace(s, value=factor * s.value)


def late(seconds: float) -> Callable[[Signal], Signal]:
    return lambda s: replace(s, value=np.interp(s.time_s - seconds, s.time_s, s.value))


def holed(s: Signal) -> Signal:
    value = s.value.copy()
    value[::7] = np.nan
    return replace(s, value=value)


def written(drive: Recording, file: Path, **changes: Callable[[Signal], Signal]) -> Path:
    """The drive as a table, some of its channels changed."""
    for name, change in changes.items():
        drive = replace(drive, signals={**drive.signals, name: change(drive.signals[name])})
    file.write_text(csv_text(drive))
    return file


def test_damaged_channels_are_reported_one_by_one_and_the_others_judged(
    drive: Recording, tmp_path: Path, loaderhil: Call
) -> None:
    """A dead sensor, holes, nothing but holes, degrees under a heading of radians, a clock of its own: none becomes a finding."""
    file = written(
        drive,
        tmp_path / "drive.csv",
        roll_rate=lambda s: replace(s, value=np.full(s.value.size, 0.1)),
        specific_force_x=holed,
        specific_force_z=scaled(float("nan")),
        yaw_rate=scaled(180.0 / np.pi),
        specific_force_y=late(1.6),
    )
    ended = loaderhil("diagnose", file, "--model", "loader")
    assert ended.result is not None, ended.err
    texts: dict[str, str] = {}
    for c in ended.result.complaints:
        texts[c.signal] = f"{texts.get(c.signal, '')}; {c.text}"
    assert "is constant at 0.1 rad/s: a dead sensor" in texts["roll_rate"]
    assert "samples are not numbers; dropped" in texts["specific_force_x"]
    assert "has 0 usable samples" in texts["specific_force_z"]
    assert "deg/s under a heading of rad/s" in texts["yaw_rate"]
    assert (
        "recorded with another clock? Left out; try again with --shift specific_force_y=-1.6"
        in texts["specific_force_y"]
    )
    assert not ended.result.named
    assert {n.channel for n in ended.result.noise} == {"specific_force_x", *loader.SPEEDS}


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("yaw_rate", lambda s: replace(s, unit="m"), "is in m, the model loader needs rad/s"),
        ("articulation_angle", lambda s: Signal(s.time_s[:1], s.value[:1], s.unit), "has fewer than 2 usable samples"),
        ("wheel_torque_rear_left", scaled(float("nan")), "has fewer than 2 usable samples"),
    ],
)  # fmt: skip
def test_a_recording_without_a_usable_needed_channel_ends_at_once(
    name: str,
    change: Callable[[Signal], Signal],
    said: str,
    drive: Recording,
    tmp_path: Path,
    loaderhil: Call,
) -> None:
    ended = loaderhil(
        "diagnose", written(drive, tmp_path / "drive.csv", **{name: change}), "--model", "loader"
    )
    assert ended.code == 5
    assert ended.result is not None
    assert f"{name} {said}" in ended.result.reasons[0]
