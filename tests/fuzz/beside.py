"""Readers whose file refers to others, or needs a model: what stands beside it is sound, so that the mutated one is read to its end."""

import functools
import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

CORPUS = Path(__file__).with_name("corpus")
DESCRIPTION = "modelDescription.xml"


@contextmanager
def _folder_with(file: Path, name: str) -> Iterator[Path]:
    """A folder in which the file has the name that its reader expects."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(file, Path(folder) / name)
        yield Path(folder)


def run_folder(file: Path) -> object:
    """A run directory whose run.json is the file; its truth and log are no such files at all."""
    from hil.rundir import BUS, RECORD, TRUTH, RunDirectory

    with _folder_with(file, RECORD) as folder:
        shutil.copy(file, folder / TRUTH)
        shutil.copy(CORPUS / "drive.log", folder / BUS)
        return RunDirectory.read(folder)


def truth_of_a_run(file: Path) -> object:
    """A run directory whose truth is the file, with every column read."""
    from hil.rundir import BUS, RECORD, TRUTH, RunDirectory

    with _folder_with(file, TRUTH) as folder:
        shutil.copy(CORPUS / "record.json", folder / RECORD)
        shutil.copy(CORPUS / "drive.log", folder / BUS)
        return {name: column.sum() for name, column in RunDirectory.read(folder).truth.items()}


def faults_of_a_run(file: Path) -> object:
    """The faults that a run's directory records."""
    from hil.faults.record import read_faults
    from hil.rundir import FAULTS

    with _folder_with(file, FAULTS) as folder:
        return read_faults(folder)


def bench_of_a_record(file: Path) -> object:
    """What `conform` keeps of the bench beside a record."""
    from testbench.conform.live import BENCH, kept_bench

    with _folder_with(file, BENCH) as folder:
        return kept_bench(folder)


def rig(file: Path) -> object:
    """A description of a rig's log, whose table is sound."""
    from identify.rig.files import read_rig

    with _folder_with(file, "rig.toml") as folder:
        shutil.copy(CORPUS / "rig.beside", folder / "run.csv")
        return read_rig(folder / "rig.toml")


def field(file: Path) -> object:
    """A description of a field test, whose tables and map are sound."""
    from identify.field.files import read_field

    with _folder_with(file, "field.toml") as folder:
        for name in ("vicon.csv", "somat.csv", "ground.csv"):
            shutil.copy(CORPUS / name.replace(".csv", ".beside"), folder / name)
        return read_field(folder / "field.toml")


def ground(file: Path) -> object:
    """A map of the ground beside a sound description."""
    from identify.field.files import read_field

    with _folder_with(file, "ground.csv") as folder:
        shutil.copy(CORPUS / "test.field", folder / "field.toml")
        for name in ("vicon.csv", "somat.csv"):
            shutil.copy(CORPUS / name.replace(".csv", ".beside"), folder / name)
        return read_field(folder / "field.toml")


def matlab(file: Path) -> object:
    """The channels of a rig in a MATLAB file."""
    from identify.reading import read_channels
    from identify.rig.files import CHANNELS

    columns, units = {n: c for n, (c, _) in CHANNELS.items()}, {n: unit for n, (_, unit) in CHANNELS.items()}
    return read_channels(file, columns, units, given=units)


def identification(file: Path) -> object:
    """An identification, scored against a sound sealed truth."""
    from identify.score import scored

    return scored(file, CORPUS / "truth.sealed")


def extension(file: Path) -> object:
    """Findings that `--apply` wrote, against the model of the straight drive."""
    from diagnosis.apply.extension import read
    from discrepancy.models import straight

    return read(file, straight.model())


def fmu(file: Path) -> object:
    """The description of an FMU."""
    from fmi.description import read_description

    return read_description(file)


def companion(file: Path) -> object:
    """The companion of a sound FMU."""
    from fmi.companion import read_companion

    return read_companion(_sound_fmu(), file)


@functools.cache
def _sound_fmu():  # type: ignore[no-untyped-def]  # fmi is imported by those who read with it alone
    from fmi.description import read_description

    return read_description(CORPUS / "tank.fmu")


def unpacked_fmu(content: bytes) -> bytes:
    """The description in an FMU."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return archive.read(DESCRIPTION)


def packed_fmu(description: bytes) -> bytes:
    """The sound FMU with another description."""
    out = BytesIO()
    with zipfile.ZipFile(CORPUS / "tank.fmu") as sound, zipfile.ZipFile(out, "w") as archive:
        for entry in sound.infolist():
            archive.writestr(entry, description if entry.filename == DESCRIPTION else sound.read(entry))
    return out.getvalue()


def unpacked_truth(content: bytes) -> bytes:
    """The text behind the seal."""
    import base64
    import zlib

    return zlib.decompress(base64.b64decode(b"".join(content.splitlines()[1:])))


def packed_truth(plain: bytes) -> bytes:
    """The text sealed again."""
    import base64
    import zlib

    from diagnosis.blind.seal import HEAD

    return HEAD.encode() + b"\n" + base64.b64encode(zlib.compress(plain)) + b"\n"
