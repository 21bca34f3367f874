"""`loaderhil export-c`: what it writes compiles and passes static analysis; what it refuses."""

import re
import shutil
import subprocess

import pytest
from typer.testing import CliRunner

from deploy.c.calibration import calibration_files
from deploy.c.estimators import estimator_files
from ecu.calibration import load_calibration
from loaderhil.commands import COMMANDS
from tests.deploy.c.building import STRICT, build


@pytest.fixture
def export(invoke):
    return lambda *words: invoke("export-c", *map(str, words))


@pytest.fixture(scope="module")
def invoke():
    import importlib

    import typer

    def run(name, *words):
        app = typer.Typer()
        app.callback()(lambda: None)
        importlib.import_module(COMMANDS[name].module).register(app)
        return CliRunner().invoke(app, [name, *words])

    return run


def test_what_is_written_compiles_without_a_warning(export, tmp_path):
    assert export(tmp_path / "c", "--calibration", "compact").exit_code == 0
    for source in sorted((tmp_path / "c").glob("*.c")):
        build([source], tmp_path / "object.o", *STRICT, "-c")


def test_static_analysis_finds_nothing(export, tmp_path):
    if shutil.which("cppcheck") is None:
        pytest.skip("no cppcheck: Debian's package cppcheck")
    assert export(tmp_path / "c").exit_code == 0
    done = subprocess.run(
        ["cppcheck", "--enable=warning,style,performance,portability", "--std=c99", "--quiet", "--error-exitcode=1",
         "--suppress=missingIncludeSystem", "--inline-suppr", "-UECU_DOUBLE", "-UECU_PERTURBED", str(tmp_path / "c")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_equal_sources_give_equal_files():
    """Nothing of the time, the folder or a hash's order goes into the text."""
    assert estimator_files() == estimator_files()
    assert calibration_files(load_calibration()) == calibration_files(load_calibration())


def test_the_heap_and_the_library_are_not_used():
    text = estimator_files()["estimators.c"]
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    assert not re.findall(r"\b(malloc|calloc|free|printf|alloca|goto|while)\b", code)


def test_a_folder_of_somebody_else_is_left_alone(export, tmp_path):
    (tmp_path / "real.h").write_text("mine")
    assert export(tmp_path).exit_code != 0
    assert (tmp_path / "real.h").read_text() == "mine"


def test_an_earlier_export_is_replaced(export, tmp_path):
    assert export(tmp_path).exit_code == 0
    (tmp_path / "calibration.c").write_text("old")
    assert export(tmp_path).exit_code == 0
    assert "calibration_parameters" in (tmp_path / "calibration.c").read_text()
