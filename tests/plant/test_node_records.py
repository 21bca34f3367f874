"""What a run leaves behind: truth columns and reaction stamps."""

import numpy as np

from plant.latency import ReactionStamps
from plant.recorder import TruthRecorder
from plant.truth import Truth


def test_every_sample_is_kept_in_order_past_the_capacity_and_through_the_file(tmp_path):
    truth = TruthRecorder(capacity=4)
    scratch = np.zeros(Truth.size)
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
    TruthRecorder().save(tmp_path / "truth.npz")
    with np.load(tmp_path / "truth.npz") as file:
        assert list(file.files) == list(Truth.fields)
        assert {len(file[name]) for name in file.files} == {0}


def rows(stamps: ReactionStamps) -> list[tuple[int, ...]]:
    r = stamps.reactions()
    return list(
        zip(*(column.tolist() for column in (r.sequence, r.sent_ns, r.limits_ns, r.status_ns)), strict=True)
    )


def test_an_echo_is_matched_with_its_sample_and_its_limits():
    stamps = ReactionStamps()
    stamps.sent(65535, 100)
    stamps.sent(0, 200)
    stamps.limits(230)
    stamps.status(65535, 240)
    stamps.limits(330)
    stamps.status(0, 340)
    assert rows(stamps) == [(65535, 100, 230, 240), (0, 200, 330, 340)]


def test_unknown_repeated_and_limitless_echoes_are_no_reactions():
    stamps = ReactionStamps()
    stamps.limits(5)
    stamps.status(7, 10)  # never sent
    stamps.sent(7, 100)
    stamps.status(7, 110)  # the Limits frame was lost
    stamps.limits(120)
    stamps.status(7, 130)
    stamps.limits(220)
    stamps.status(7, 230)  # the same echo again: no new sample reached the ECU
    assert rows(stamps) == [(7, 100, 120, 130)]
