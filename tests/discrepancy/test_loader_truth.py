"""Bodies of truth for the loader: what is hidden is in the recording, and nothing else is changed."""

from dataclasses import replace

import numpy as np
import pytest

from bench.loader_truth import Arm, arms, hidden, record
from discrepancy.models import loader


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    arm = Arm(seed=5, duration_s=1.5)
    truths = {
        "plain": record(arm, folder / "plain"),
        "again": record(arm, folder / "again"),
        "biased": record(replace(arm, effects=("yaw_rate bias",), scale=2.0), folder / "biased"),
    }
    return folder, truths


def test_equal_arms_give_equal_frames(made):
    folder, truths = made
    assert truths["plain"] == truths["again"]
    assert (folder / "plain" / "bus.log").read_bytes() == (folder / "again" / "bus.log").read_bytes()


def test_a_hidden_bias_is_in_its_channel_and_nowhere_else(made):
    """The bias is in the truth that is returned and, but for the steps of the frame, in the channel."""
    folder, truths = made
    assert truths["biased"]["yaw_rate.bias"] == pytest.approx(
        2.0 * loader.model().parameter("yaw_rate.bias").typical
    )
    plain, biased = (loader.load_run(folder / name).signals for name in ("plain", "biased"))
    shift = biased["yaw_rate"].value - plain["yaw_rate"].value
    np.testing.assert_allclose(shift, truths["biased"]["yaw_rate.bias"], atol=2e-4)
    np.testing.assert_array_equal(biased["roll_rate"].value, plain["roll_rate"].value)


def test_every_arm_of_a_report_is_one_of_the_library():
    model = loader.model()
    for arm in arms():
        assert arm.seed >= 1000
        for name, value in hidden(model, arm).items():
            p = model.parameter(name)
            assert p.lower <= value <= p.upper
            assert p.shape or value != p.value


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"payload_kg": "much"}', '{"payload_kg": -3}'])
def test_a_damaged_record_of_a_run_is_named(tmp_path, text):
    path = tmp_path / "run.json"
    path.write_text(text)
    with pytest.raises(loader.DamagedRecord, match=r"run\.json"):
        loader._constants(path)


def test_without_a_record_nothing_is_known_of_the_day(tmp_path):
    assert loader._constants(tmp_path / "run.json") == {}
