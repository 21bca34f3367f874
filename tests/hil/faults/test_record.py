"""faults.json of a run directory: read back as written, and one line when it is damaged."""

import pytest

from hil.faults.record import Injected, read_faults, write_faults
from hil.rundir import FAULTS, RunError


def test_faults_are_read_back_as_they_were_written(tmp_path):
    faults = [Injected(1, "drop WheelSpeeds", 0.5, 2.0, 17), Injected(2, "kill process=ecu", 1.0, None, 0)]
    write_faults(tmp_path, faults)
    assert read_faults(tmp_path) == faults


def test_a_run_without_faults_has_none(tmp_path):
    assert read_faults(tmp_path) == []


@pytest.mark.parametrize(
    "content",
    [b"", b"[{}]", b'{"number": 1}', b"\xff\x00", b"[" * 100_000, b'[{"number": "x", "fault": 1}]', b'[{"number": 1, "fault": "drop", "began_s": 0, "ended_s": null, "struck": 0, "more": 1}]'],
)  # fmt: skip
def test_a_damaged_file_is_one_line_that_names_it(tmp_path, content):
    (tmp_path / FAULTS).write_bytes(content)
    with pytest.raises(RunError, match=r"faults\.json: .*damaged") as error:
        read_faults(tmp_path)
    assert "\n" not in str(error.value)


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(RunError, match=r"faults\.json: cannot be written"):
        write_faults(tmp_path / "missing", [])
