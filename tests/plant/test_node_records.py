"""What a run leaves behind: truth columns."""

import numpy as np

from plant.recorder import TruthRecorder
from plant.truth import Truth


def test_every_sample_is_kept_in_order_through_the_file(tmp_path):
    scratch = np.zeros(Truth.size)
    with TruthRecorder(tmp_path) as truth:
        for k in range(11):
            scratch[:] = k  # the recorder must copy: the plant may reuse its arrays
            scratch[Truth.time_s.at] = k * 0.01
            truth.append(Truth(scratch))
        truth.save(tmp_path / "truth.npz")
    with np.load(tmp_path / "truth.npz") as file:
        np.testing.assert_array_equal(file["time_s"], np.arange(11) * 0.01)
        np.testing.assert_array_equal(file["normal_force"], np.repeat(np.arange(11.0), 4).reshape(11, 4))
    assert [path.name for path in tmp_path.iterdir()] == ["truth.npz"]


def test_a_recorder_without_samples_writes_a_readable_empty_file(tmp_path):
    with TruthRecorder(tmp_path) as truth:
        truth.save(tmp_path / "truth.npz")
    with np.load(tmp_path / "truth.npz") as file:
        assert list(file.files) == list(Truth.fields)
        assert {len(file[name]) for name in file.files} == {0}
