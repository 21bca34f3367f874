"""Machine code is made again when any source changes, also one that the function only calls."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from bus.machine_code import KEPT_S, NoCacheFolderError, code_folder, digest_of

ROOT = Path(__file__).resolve().parents[2]
OUTER = """\
from pathlib import Path
from bus.machine_code import code_folder, compiler, digest_of
here = Path(__file__).parent
folder = code_folder(here, "code", digest_of(sorted(here.glob("*.py"))))
compiled = compiler(folder)
from inner import inner

@compiled
def outer():
    return inner()

print(outer(), sum(outer.stats.cache_hits.values()))
"""
INNER = """\
from numba import njit

@njit
def inner():
    return {value}
"""


@pytest.mark.processes
@pytest.mark.parametrize("chosen", [False, True], ids=["beside the source", "NUMBA_CACHE_DIR"])
def test_a_changed_callee_is_noticed_and_an_unchanged_one_is_not_compiled_again(tmp_path, chosen):
    package = tmp_path / "package"
    package.mkdir()
    (package / "outer.py").write_text(OUTER)
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(ROOT)
    if chosen:
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "chosen")
    said = []
    for value in (1, 1, 2):
        (package / "inner.py").write_text(INNER.format(value=value))
        done = subprocess.run(
            [sys.executable, package / "outer.py"],
            capture_output=True,
            text=True,
            env=environment,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.split())
    assert said == [["1", "0"], ["1", "1"], ["2", "0"]]
    assert (package / "__pycache__").exists() != chosen or not list((package / "__pycache__").glob("code-*"))


def test_the_digest_changes_when_content_moves_between_files(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text("x")
    second.write_text("yz")
    before = digest_of([first, second])
    first.write_text("xy")
    second.write_text("z")
    assert digest_of([first, second]) != before


def test_code_of_long_ago_is_removed_and_that_of_today_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    old, recent, other = (tmp_path / name for name in ("plant-old", "plant-recent", "estimators-old"))
    for folder in (old, recent, other):
        folder.mkdir()
        (folder / "code.nbc").touch()
    now = recent.stat().st_mtime
    for folder in (old, other):
        os.utime(folder, (now - 2 * KEPT_S, now - 2 * KEPT_S))
    made = code_folder(tmp_path, "plant", "new")
    assert made == tmp_path / "plant-new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimators-old", "plant-new", "plant-recent"]


def test_where_the_package_cannot_be_written_to_the_users_cache_is_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    package = tmp_path / "a file"
    package.touch()
    assert code_folder(package, "plant", "0") == tmp_path / "cache" / "loaderhil" / "plant-0"


def test_without_any_place_the_error_names_them_all(tmp_path, monkeypatch):
    nowhere = tmp_path / "a file"
    nowhere.touch()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(nowhere / "chosen"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere / "cache"))
    with pytest.raises(NoCacheFolderError, match=r"chosen.*a file.*cache.*permissions"):
        code_folder(nowhere, "plant", "0")
