"""What a run leaves behind: truth columns, row by row until its end."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from plant.recorder import TruthRecorder, read_rows, rows_of
from plant.truth import Truth


def test_every_sample_is_kept_in_order_through_the_file(tmp_path):
    scratch = np.zeros(Truth.size)
    with TruthRecorder(tmp_path / "truth.npz") as truth:
        for k in range(11):
            scratch[:] = k  # the recorder must copy: the plant may reuse its arrays
            scratch[Truth.time_s.at] = k * 0.01
            truth.append(Truth(scratch))
        truth.save()
    with np.load(tmp_path / "truth.npz") as file:
        np.testing.assert_array_equal(file["time_s"], np.arange(11) * 0.01)
        np.testing.assert_array_equal(file["normal_force"], np.repeat(np.arange(11.0), 4).reshape(11, 4))
    assert [path.name for path in tmp_path.iterdir()] == ["truth.npz"]


def test_a_recorder_without_samples_writes_a_readable_empty_file(tmp_path):
    with TruthRecorder(tmp_path / "truth.npz") as truth:
        truth.save()
    with np.load(tmp_path / "truth.npz") as file:
        assert list(file.files) == list(Truth.fields)
        assert {len(file[name]) for name in file.files} == {0}


def test_a_killed_process_leaves_every_row(tmp_path):
    """kill -9 right after a row was appended and said so."""
    code = """
import sys, time
from pathlib import Path
import numpy as np
from plant.recorder import TruthRecorder
from plant.truth import Truth
truth = TruthRecorder(Path(sys.argv[1]))
for k in range(1000):
    truth.append(Truth(np.full(Truth.size, k / 100)))
    print(k, flush=True)
    time.sleep(0.0005)
time.sleep(100)
"""
    path = tmp_path / "truth.npz"
    with subprocess.Popen([sys.executable, "-c", code, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) == 300:
                os.kill(process.pid, signal.SIGKILL)
                break
        said = [int(line) for line in process.stdout]
    rows = read_rows(rows_of(path))
    assert len(rows["time_s"]) > max(said, default=300)
    np.testing.assert_array_equal(rows["time_s"], np.arange(len(rows["time_s"])) / 100)


@pytest.mark.parametrize("cut", [1, Truth.size * 8 - 1, Truth.size * 8])
def test_half_a_row_is_left_out(tmp_path, cut):
    with TruthRecorder(tmp_path / "truth.npz") as truth:
        for k in range(5):
            truth.append(Truth(np.full(Truth.size, float(k))))
    file = rows_of(tmp_path / "truth.npz")
    file.write_bytes(file.read_bytes()[:-cut])
    np.testing.assert_array_equal(read_rows(file)["time_s"], np.arange(4.0))


@pytest.mark.parametrize("content", [b"", b"truth", b"x" * 1000])
def test_rows_of_another_version_are_refused(tmp_path, content):
    (tmp_path / "truth.rows").write_bytes(content)
    with pytest.raises(ValueError, match="no rows of this version"):
        read_rows(tmp_path / "truth.rows")
