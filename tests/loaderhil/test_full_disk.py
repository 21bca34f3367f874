"""A disk that is full ends a command in one line that names the file, and leaves no half file behind."""

import subprocess
import sys
from pathlib import Path

import pytest

LIMIT = 4096
"""Bytes that a file may have here: write(2) then fails as on a full disk, with EFBIG instead of ENOSPC."""


def limited(*words: object) -> subprocess.CompletedProcess[str]:
    """`loaderhil WORDS` with small files only."""
    code = (
        f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({LIMIT}, {LIMIT}))\n"
        "from loaderhil.__main__ import main; main()"
    )
    command = [sys.executable, "-B", "-c", code, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "drive.log"
    lines = (
        f"({1_700_000_000 + k / 1000:.6f}) can0 0C0#{k % 256:02X}00000000000000\n" for k in range(20_000)
    )
    file.write_text("".join(lines))
    return file


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    file = tmp_path / "one.dbc"
    file.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: N\nBO_ 192 Message: 8 N\n SG_ Signal : 0|8@1+ (1,0) [0|0] "" N\n'
    )
    return file


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_decode_names_the_table_that_does_not_fit(tmp_path: Path, log: Path, dbc: Path, form: str) -> None:
    out = tmp_path / "tables"
    done = limited("decode", log, "--dbc", dbc, "--out", out, "--format", form)
    assert done.returncode == 1
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("loaderhil:")]
    assert f"{out / 'Message'}.{form}: cannot be written: " in line
    assert "Traceback" not in done.stderr
    assert list(out.iterdir()) == []
