"""What a user gets wrong ends in one line and exit code 2; what is right says what it did."""

import os
import subprocess
import sys
import threading
from importlib.metadata import version

import pytest
from rich.console import Console
from typer.testing import CliRunner

import loaderhil.__main__
from dbc import loader_database
from hil.ending import Ending
from loaderhil.__main__ import main
from loaderhil.cli import app, load_command
from loaderhil.commands import COMMANDS, PANELS


@pytest.fixture(scope="module")
def invoke():
    runner = CliRunner()
    return lambda *words: runner.invoke(app, [str(word) for word in words])


def loaderhil(*words):
    """The installed program, as a user calls it."""
    return subprocess.run(
        [sys.executable, "-m", "loaderhil", *map(str, words)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_the_version(invoke):
    result = invoke("--version")
    assert result.exit_code == 0
    assert result.output == f"loaderhil {version('loaderhil')}\n"


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_page_has_the_summary_of_the_command(command):
    summary = load_command(command).help.partition("\n\n")[0]
    assert COMMANDS[command].summary == " ".join(summary.split())


def test_the_help_page_loads_no_command():
    """The page is shown at once only if no command's libraries are loaded for it."""
    code = "import atexit, sys; atexit.register(lambda: print(*sys.modules)); from loaderhil.cli import main; main()"
    shown = subprocess.run(
        [sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=True
    ).stdout
    modules = shown.splitlines()[-1].split()
    assert "typer" in modules
    assert not {"numpy", "numba", "scipy", "pyarrow", "pydantic", "pandas", "can", "plant", "ecu"} & set(
        modules
    )
    # it draws the boxes of the commands' own help pages, and takes twice as long as everything else here
    assert "rich" not in modules


def modules_after(code, environment=None):
    """Names of the modules that are loaded after `code`, in a process of its own."""
    shown = subprocess.run(
        [sys.executable, "-c", f"import sys; {code}; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    return set(shown.stdout.split())


def test_a_run_in_lockstep_loads_no_library_for_tables_and_no_parser():
    """cantools loads python-can, that asammdf, and that pandas and pyarrow."""
    loader_database()  # from now on it is kept
    loaded = modules_after(
        "import hil.compose, hil.rundir, loaderhil.single; from dbc import loader_database; loader_database()"
    )
    assert "numba" in loaded
    assert not {"pandas", "pyarrow", "asammdf", "matplotlib", "rich.markdown", "hdrh"} & loaded
    assert not {"cantools", "can", "hil.processes.realtime"} & loaded


def test_a_dbc_that_is_new_brings_no_library_for_tables(tmp_path):
    """pandas and pyarrow came with asammdf, that with python-can, and that with cantools."""
    nothing_kept = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    loaded = modules_after("from dbc import loader_database; loader_database()", nothing_kept)
    assert {"cantools", "can"} <= loaded
    assert not {"pandas", "pyarrow", "asammdf", "matplotlib"} & loaded


def test_mf4_is_read_after_a_dbc_was(tmp_path):
    """asammdf is hidden from python-can only while that is loaded, which a DBC that is not kept does."""
    code = "from dbc import loader_database; loader_database(); import asammdf, can.io.mf4; print(asammdf.MDF, can.io.mf4.asammdf)"
    nothing_kept = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=nothing_kept
    ).stdout
    assert shown.split() == ["<class", "'asammdf.mdf.MDF'>", "None"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(invoke, command):
    assert command in invoke("--help").output
    result = invoke(command, "--help")
    assert result.exit_code == 0
    assert "Usage" in result.output


def test_the_help_shows_every_command_under_its_title():
    page = loaderhil("--help").stdout
    places = [page.index(title) for title in PANELS]
    assert places == sorted(places)


@pytest.mark.parametrize(
    "words",
    [
        ("run",),
        ("run", "loaded", "--form", "guessed"),
        ("run", "loaded", "--payload-kg", "-1"),
        ("fly",),
    ],
)
def test_misuse_is_exit_code_2(invoke, words):
    assert invoke(*words).exit_code == Ending.MISUSED


def test_scenarios_are_listed_with_their_sentence_in_80_columns(invoke, monkeypatch):
    monkeypatch.setattr("loaderhil.tables.console", Console(width=80, highlight=False))
    lines = invoke("scenarios").output.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("abrupt_articulation"))
    assert lines[at].split(maxsplit=1)[1].startswith("Full joystick to the left at 22 km/h")
    assert lines[at + 1].startswith("10 s, l60 ")
    assert any(line.startswith("9 s, l60, 1600 kg") for line in lines)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("run", "no_such_case"), "no_such_case"),
        (("run", "broken.toml"), "duration_s"),
        (("report", "nowhere"), "nowhere: no such run directory"),
        (("hub", "--bus", "socketcan:can0"), "hub:PATH"),
    ],
)
def test_a_users_error_is_one_line_without_a_traceback(tmp_path, monkeypatch, words, named):
    (tmp_path / "broken.toml").write_text(
        'name = "broken"\nsentence = "x"\nduration_s = -3.0\nmachine = "l60"\n'
    )
    monkeypatch.chdir(tmp_path)
    result = loaderhil(*words)
    assert result.returncode in (Ending.MISUSED, Ending.HUB_LOST)
    assert result.stderr.startswith("loaderhil: ")
    assert len(result.stderr.splitlines()) == 1
    assert named in result.stderr


def test_a_folder_with_other_things_in_it_is_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    result = loaderhil("run", "standstill", "--out", tmp_path)
    assert result.returncode == Ending.MISUSED
    assert "not empty" in result.stderr


def test_a_lockstep_run_says_what_happened(tmp_path):
    result = loaderhil("run", "standstill", "--out", tmp_path / "run")
    assert result.returncode == Ending.PASSED, result.stderr
    assert "true lift-off" in result.stdout
    assert (tmp_path / "run" / "run.json").exists()


def test_blas_gets_one_thread_before_numpy_is_loaded():
    """What is loaded before `main` says so must not have loaded it."""
    code = "import loaderhil.__main__, sys; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class _Interrupting:
    """Ctrl-C comes while the command line is being imported."""

    def find_spec(self, name, *_):
        if name == "loaderhil.cli":
            raise KeyboardInterrupt


def test_ctrl_c_while_the_command_line_is_loaded_is_no_traceback(monkeypatch):
    monkeypatch.delitem(sys.modules, "loaderhil.cli")
    monkeypatch.setattr(sys, "meta_path", [_Interrupting(), *sys.meta_path])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == Ending.INTERRUPTED


def test_ctrl_c_inside_a_command_is_reported_once(monkeypatch, capsys):
    """Typer makes an exit without a word of it."""

    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("loaderhil.tables.show_scenarios", interrupted)
    monkeypatch.setattr("hil.shell.interruption._reported", threading.Event())
    monkeypatch.setattr(sys, "argv", ["loaderhil", "scenarios"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == Ending.INTERRUPTED
    assert capsys.readouterr() == ("", "loaderhil: interrupted\n")


@pytest.mark.parametrize("module", ["hil.processes.gateway_command", "hil.recording.command", "hil.rundir"])
def test_gateway_and_recorder_load_no_compiler(module):
    """numba takes more memory than all the rest of them; judging deadlines must not bring it in with the readers of recordings."""
    loaded = modules_after(f"import {module}")
    assert module in loaded
    assert not {"numba", "llvmlite"} & loaded
