"""The Modelica Association's reference FMUs, made by another tool: they validate, and move as plant as FMPy moves them.

scripts/fetch-data fetches the archive of their release, scripts/build-reference-fmus builds them from their sources.
Without either these tests are skipped, and the foreign FMUs of tests/fmi/test_plant.py, compiled on this computer,
stand for them.
"""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from fmi.archive import FmuError
from fmi.description import read_description
from fmi.motion import motion_of
from plant.plant import Commands
from plant.unit.signals import CHANNELS

BROKEN = "2.0/Feedthrough.fmu"
"""Of release 0.0.39, as other importers say, which take it from an earlier one."""
ARCHIVES = ("reference_fmus/Reference-FMUs-0.0.39.zip", "reference_fmus/built.zip")
"""The release as it was fetched, or what was built from its sources."""
OUTPUTS = {"Dahlquist": "x", "VanDerPol": "x0"}
"""Model -> an output without a unit that changes."""
MOVING = [(version, name) for version in ("2.0", "3.0") for name in OUTPUTS]


@pytest.fixture(scope="session")
def archive(recordings: Path) -> Path:
    """A zip archive of the FMUs, in the folders 2.0 and 3.0."""
    for name in ARCHIVES:
        if (recordings / name).is_file():
            return recordings / name
    pytest.skip(
        f"no reference FMUs in {recordings / 'reference_fmus'}: scripts/fetch-data fetches them from GitHub, "
        "scripts/build-reference-fmus builds them from a checkout of their sources"
    )


def test_a_height_is_no_angle(archive, tmp_path):
    file = unpacked(archive, "3.0", "BouncingBall", tmp_path)
    with pytest.raises(FmuError, match="h is in m, articulation_angle is in rad"):
        motion_of(connected_to(file, "h"))


def connected_to(file: Path, output: str) -> Path:
    """The FMU as plant, whose articulation angle is this output; every other sensor reads 0."""
    constants = "".join(f"{channel} = 0.0\n" for channel in CHANNELS if channel != "articulation_angle")
    file.with_suffix(".toml").write_text(
        f"[plant.outputs]\narticulation_angle = '{output}'\n[plant.constants]\n{constants}"
    )
    return file


def unpacked(archive: Path, version: str, name: str, folder: Path) -> Path:
    with zipfile.ZipFile(archive) as opened:
        return Path(opened.extract(f"{version}/{name}.fmu", folder))


def test_they_all_validate_and_are_read(archive, tmp_path):
    with zipfile.ZipFile(archive) as opened:
        names = [n for n in opened.namelist() if n.startswith(("2.0/", "3.0/")) and n.endswith(".fmu")]
        names = [n for n in names if n != BROKEN]
        opened.extractall(tmp_path, names)
    assert len(names) >= 10
    for name in names:
        assert validate_fmu(str(tmp_path / name)) == [], name
        if name == "3.0/Clocks.fmu":
            with pytest.raises(FmuError, match="is for scheduled execution only"):
                read_description(tmp_path / name)
        else:
            read_description(tmp_path / name)


@pytest.mark.parametrize(("version", "name"), MOVING)
def test_as_plant_they_move_as_with_fmpy(archive, tmp_path, version, name):
    file = unpacked(archive, version, name, tmp_path)
    output = OUTPUTS[name]
    motion, ours = motion_of(connected_to(file, output)), []
    for _ in range(300):
        ours.append(motion.truth().articulation_angle)
        motion.advance(Commands(), 0.01)
    found = simulate_fmu(
        str(file),
        stop_time=2.99,
        step_size=0.01,
        output_interval=0.01,
        output=[output],
        fmi_type="CoSimulation",
    )
    np.testing.assert_allclose(ours, found[output][:300], rtol=1e-12, atol=1e-12)
    assert np.ptp(ours) > 0.1
