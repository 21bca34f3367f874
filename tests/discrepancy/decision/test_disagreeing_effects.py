"""An effect that clearly helps but of which blocks of time disagree on the size: it is neither found nor ruled out, beside a finding too."""

from collections.abc import Mapping
from functools import cache

import numpy as np

from discrepancy.examine import examine
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Array, Recording, signal

SD, STEP_S, DURATION_S = 0.05, 0.05, 120.0
NAMES = ("steady", "changing", "absent")


def model() -> Model:
    """y = the sum of three known signals, each times an effect that the baseline has not."""

    def simulate(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
        return {"y": np.sum([values[f"{n}.share"] * window[n] for n in NAMES], axis=0)}

    def effect(name: str) -> Effect:
        share = Parameter(name=f"{name}.share", unit="1", lower=-5.0, upper=5.0, typical=0.5)
        return Effect(name=name, sentence="", equation="", parameters=(share,), kind="physics", place=name)

    return Model(
        name="sum",
        sentence="",
        inputs=dict.fromkeys(NAMES, "1"),
        outputs={"y": "m"},
        nuisances=(),
        effects=tuple(effect(n) for n in NAMES),
        simulate=simulate,
        step_s=STEP_S,
        window_s=10.0,
    )


@cache
def diagnosed(steady: float, changing: float) -> Findings:
    """Of a recording with both; the second one changes its sign and its size every ten seconds."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, DURATION_S, STEP_S)
    known = {
        n: np.sin(2.0 * np.pi * f * t + i)
        for i, (n, f) in enumerate(zip(NAMES, (0.31, 0.53, 0.77), strict=True))
    }
    size = changing * rng.choice([-1.0, 3.0], t.size)[(t // 10.0).astype(int)]
    y = steady * known["steady"] + size * known["changing"] + SD * rng.standard_normal(t.size)
    signals = {n: signal(t, v, "1") for n, v in known.items()} | {"y": signal(t, y, "m")}
    return examine(model(), [Recording(name="drive", signals=signals)], Settings(open_ended=False))


def test_it_is_not_ruled_out_beside_a_finding_and_the_result_says_so() -> None:
    found = diagnosed(1.0, 0.1)
    assert [(x.effect, x.named) for x in found.findings] == [("steady", True)]
    assert found.status == "explained in part"
    assert any("changing would improve the prediction much" in reason for reason in found.reasons)
    by_name = {c.effect: c for c in found.candidates}
    assert by_name["changing"].verdict == "could not be judged"
    assert "blocks of time disagree on its size" in by_name["changing"].reason
    assert by_name["absent"].verdict != "could not be judged"


def test_alone_it_makes_the_result_unknown() -> None:
    found = diagnosed(0.0, 0.1)
    assert found.status == "unknown"
    assert found.findings == []
    assert any("changing would improve the prediction much" in reason for reason in found.reasons)


def test_without_it_the_finding_explains_all() -> None:
    found = diagnosed(1.0, 0.0)
    assert found.status == "explained"
    assert not [c.effect for c in found.candidates if c.verdict == "could not be judged"]
