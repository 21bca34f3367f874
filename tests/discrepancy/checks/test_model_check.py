"""A fault of a model is reported as one, in one line, before a recording is blamed."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from discrepancy.examine import examine
from discrepancy.model.description import Window
from discrepancy.model.failure import BadModel
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array
from tests.discrepancy.toys import record, simulate, tank

WRONG: Mapping[str, Callable[[Window, Mapping[str, float], Mapping[str, Array]], Any]] = {
    "must return a mapping of outputs, not NoneType": lambda w, v, e: None,
    "simulate returns height, but no level": lambda w, v, e: {"height": simulate(w, v, e)["level"]},
    "simulate returns nothing, but no level": lambda w, v, e: {},
    r"returns level of shape \(199,\); it must be \(20[01],\)": lambda w, v, e: {"level": np.zeros(199)},
    "KeyError: 'arae'|KeyError: arae": lambda w, v, e: {"level": w.time_s * v["arae"]},
    "no signal 'outflow' in .*; there are inflow, level": lambda w, v, e: {"level": w["outflow"]},
    "ZeroDivisionError": lambda w, v, e: {"level": w.time_s * (1 // 0)},
}


@pytest.mark.parametrize("words", WRONG)
def test_a_model_that_fails_is_reported_and_no_recording_blamed(words: str) -> None:
    with pytest.raises(BadModel, match=words) as refused:
        examine(replace(tank(), simulate=WRONG[words]), [record(1)], Settings())
    assert "model tank" in str(refused.value)
    assert "\n" not in str(refused.value)
    if "fails" in str(refused.value):
        assert "test_model_check.py, line" in str(refused.value)


def test_an_output_that_was_not_recorded_may_be_left_out_of_what_is_returned() -> None:
    model = replace(tank(), outputs={"level": "m", "flow": "m/s"})
    assert examine(model, [record(1)], Settings()).status == "nothing missing"


@pytest.mark.parametrize(
    "change", [{"inputs": {"inflow": "l/s"}}, {"outputs": {"level": "furlong"}}, {"constants": {"mass": "g"}}]
)
def test_a_model_speaks_si(change: dict[str, dict[str, str]]) -> None:
    with pytest.raises(ValueError, match="units of a model are SI"):
        replace(tank(), **change)
