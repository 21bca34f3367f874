"""Finds the model of a diagnosis: one of loaderhil's by its name, or the user's own in a Python file or an FMU."""

import importlib.util
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from bus.user_error import UserError
from diagnosis.reading.run_directory import Native, damage_of_run, is_run, machine_of_run
from discrepancy.model.description import Model
from discrepancy.models import ball, car, road, straight
from discrepancy.signals.recording import Recording

MOVED = {
    "discrepancy.recording": "discrepancy.model",
    "discrepancy.sensors": "discrepancy.model",
    "discrepancy.terms": "discrepancy.model",
    "discrepancy.functions": "discrepancy.model",
    "discrepancy.selection.terms": "discrepancy.model",
    "discrepancy.findings": "discrepancy.signals.findings",
    "discrepancy.units": "discrepancy.signals.units",
    "discrepancy.search": "discrepancy.selection.state",
    "discrepancy.state": "discrepancy.selection.state",
}
"""Former modules that users' model files may still import, and where their names are now; for the error message."""

T = TypeVar("T")
Build = Callable[[Sequence[Recording]], Model]
BuildFrom = Callable[[Path, Sequence[Recording]], Model]
ReadNative = Callable[[Path, str | None], Native | None]


class NoModel(UserError, ValueError):
    """There is no such model, or the file does not define one."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A model, not yet built: some models depend on the channels of the recordings."""

    name: str
    build: Build  # the model for these recordings
    native: ReadNative  # reads a published data set of the model; returns None for any other path
    data: str = ""  # the data set in a few words, for error messages
    # builds it from a file of its own kind, which `diagnose --apply` writes; None: --apply writes a list of effects
    build_from: BuildFrom | None = None
    own_machine: str | None = (
        None  # machine that the model describes by default; None: no machine of the bench
    )

    @property
    def channels(self) -> Model:
        """The model before any recording is known: its channels with their units."""
        return self.build(())


def _no_data_set(_: Path, __: str | None) -> None:
    return None


def _drops(path: Path, part: str | None) -> Native | None:
    if not (path / "ball_drops.csv").is_file():
        return None
    if part is None:
        raise NoModel(
            f"{path} holds drops of several balls; name one by --part: {', '.join(map(repr, ball.WEIGHED))}"
        )
    return Native(ball.load_drops(path, part))


def _dart(path: Path, part: str | None) -> Native | None:
    files = sorted(path.glob("*.csv.gz")) if path.is_dir() else [path]
    if not files or not all(car.is_dart(file) for file in files):
        return None
    return Native([car.load_dart(file, reference=part != "on-board") for file in files])


def _build_car(recordings: Sequence[Recording]) -> Model:
    return car.model(reference=all("speed_reference" in r.signals for r in recordings))


def _run(path: Path, _: str | None) -> Native | None:
    if not is_run(path):
        return None
    damage = damage_of_run(path)
    from discrepancy.models.loader import (
        model as loader,
    )  # late: importing it loads the compiled plant, some seconds

    return Native([loader.load_run(path)], damage, machine_of_run(path))


def _build_loader(recordings: Sequence[Recording]) -> Model:
    from discrepancy.models.loader import model as loader

    return loader.model(recordings)


def _build_loader_from(machine: Path, recordings: Sequence[Recording]) -> Model:
    from diagnosis.apply import machine_files

    return machine_files.baseline(machine, recordings)


def _build_printed(recordings: Sequence[Recording]) -> Model:
    from discrepancy.models import printed

    return printed.model(recordings)


def _slow_run(path: Path, _: str | None) -> Native | None:
    if not is_run(path):
        return None
    damage = damage_of_run(path)
    from discrepancy.models import printed

    return Native([printed.load_quasi_static(path)], damage, machine_of_run(path))


def _comma(path: Path, _: str | None) -> Native | None:
    return Native([road.load_comma(path)]) if (path / "segment40.npz").is_file() else None


NAMED = {
    choice.name: choice
    for choice in (
        Choice("ball", lambda _: ball.model(), _drops, "folder with ball_drops.csv and balls.txt, with --part BALL"),
        Choice("car", _build_car, _dart, "DART csv.gz file or a folder of them; --part on-board reads it without motion capture"),
        Choice("road", road.model, _comma, "folder with one minute of comma2k19 and its DBC"),
        Choice("loader", _build_loader, _run, "run directory of the bench, with or without reference.log", _build_loader_from, "l60"),
        Choice("printed-estimator", _build_printed, _slow_run, "run directory of the bench, with reference.log", own_machine="l60"),
        Choice("straight", lambda _: straight.model(), _no_data_set),
    )
}  # fmt: skip


def find_model(text: str, companion: Path | None = None) -> Choice:
    """The model of a name, or of a file that defines `model`: a Model, or a function of the recordings that returns one.

    If the file also defines `native(path, part)`, that function reads its data sets. An FMU is a model too, with its companion file: the
    given one, else FILE.toml beside FILE.fmu. Raises a UserError.
    """
    path = Path(text)
    if companion is not None and path.suffix != ".fmu":
        raise NoModel(f"--fmu-config {companion}: is for an FMU, but the model is {text}")
    if text in NAMED:
        return NAMED[text]
    if path.suffix == ".fmu":
        from fmi.model import read_model  # late: loads FMPy

        fmu = read_model(path, companion)
        return Choice(fmu.description.name, fmu.build, _no_data_set)
    if path.suffix != ".py":
        raise NoModel(
            f"no model '{text}'; there are {', '.join(NAMED)}, a FILE.py that defines `model`, or a FILE.fmu"
        )
    if not path.is_file():
        raise NoModel(f"{path}: no such file; a model is a Python file that defines `model`")
    module = _defined(path)
    made, native = getattr(module, "model", None), getattr(module, "native", _no_data_set)
    if isinstance(made, Model):
        return Choice(made.name, lambda _: made, native)
    if not callable(made):
        what = "does not define `model`" if made is None else f"defines `model` as {type(made).__name__}"
        raise NoModel(f"{path}: {what}; it must be a discrepancy.model.Model or a function that makes one")

    def build(recordings: Sequence[Recording]) -> Model:
        model = _as_one_line(path, lambda: made(recordings))
        if not isinstance(model, Model):
            raise NoModel(f"{path}: model(recordings) returned {type(model).__name__}, not a Model")
        return model

    return Choice(build(()).name, build, native)


def _defined(path: Path) -> ModuleType:
    """The module of a user's file, run. Raises NoModel for an exception in it."""
    spec = importlib.util.spec_from_file_location(f"loaderhil_model_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module, loader = importlib.util.module_from_spec(spec), spec.loader
    sys.modules[spec.name] = module  # dataclasses look their module up
    _as_one_line(path, lambda: loader.exec_module(module))
    return module


def _as_one_line(path: Path, run: Callable[[], T]) -> T:
    """The result of the user's code. An exception in it becomes a NoModel of one line, with the line number in the user's file."""
    try:
        return run()
    except Exception as error:
        # the last frame in the user's file: deeper ones are in libraries, shallower ones call it
        frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == path]
        line = frames[-1].lineno if frames else getattr(error, "lineno", None)
        at = f", line {line}" if line else ""
        if isinstance(error, ModuleNotFoundError) and error.name in MOVED:
            raise NoModel(
                f"{path}{at}: {error.name} has moved; import the same names from {MOVED[error.name]}"
            ) from error
        raise NoModel(f"{path}{at}: {type(error).__name__}: {error}") from error
