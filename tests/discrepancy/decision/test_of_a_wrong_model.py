"""Names that only a right model allows."""

from copy import copy
from dataclasses import replace
from typing import Literal

import pytest

from discrepancy.decision.judgement import Judgement
from discrepancy.decision.sizes.of_a_wrong_model import of_a_wrong_model
from discrepancy.examine import investigate
from discrepancy.model.description import Effect
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Finding
from tests.discrepancy.toys import record, tank


@pytest.fixture(scope="module")
def late() -> Judgement:
    """A reading that comes 0.35 s late."""
    judged = investigate(tank("leak", "level delay"), [record(3, delay_s=0.35)], Settings(open_ended=False))
    assert isinstance(judged, Judgement)
    return judged


def doubted(
    judged: Judgement,
    found: list[Finding],
    *,
    matters_s: float | None = None,
    kind: Literal["sensor", "physics"] = "sensor",
) -> list[Finding]:
    """The findings, where a delay of `matters_s` is the smallest that matters, and an effect of this kind."""

    def changed(effect: Effect) -> Effect:
        own = tuple(replace(p, typical=matters_s or p.typical) for p in effect.parameters)
        return replace(effect, kind=kind, parameters=own) if effect.name == "level delay" else effect

    problem = copy(judged.problem)
    problem.model = replace(problem.model, effects=tuple(changed(e) for e in problem.model.effects))
    return of_a_wrong_model(problem, found, judged.findings.adequacy, OpenEnded())


def proxy(name: str, like: Finding) -> Finding:
    return replace(like, effect=name, named=False, caveats=["closes 10 % of the gap"])


@pytest.mark.parametrize(("matters_s", "small"), [(0.05, False), (3.0, False), (30.0, True)])
def test_beside_a_proxy_a_name_has_to_be_of_a_size_that_matters(
    late: Judgement, matters_s: float, small: bool
) -> None:
    [delay] = late.findings.findings
    assert doubted(late, [delay], matters_s=matters_s) == [delay]
    found, other = doubted(late, [delay, proxy("leak", delay)], matters_s=matters_s)
    assert not other.named
    assert found.named != small
    assert [("the change of level.delay that matters, 30 s" in said) for said in found.caveats] == [
        True
    ] * small


@pytest.mark.parametrize(("kind", "small"), [("sensor", True), ("physics", False)])
def test_physics_may_be_as_small_as_it_is(
    late: Judgement, kind: Literal["sensor", "physics"], small: bool
) -> None:
    """A sensor that is hardly off is as its sheet says; a delay of a servo is there, however short."""
    [delay] = late.findings.findings
    found, _ = doubted(late, [delay, proxy("leak", delay)], matters_s=30.0, kind=kind)
    assert found.named != small


@pytest.mark.parametrize(("delay_s", "ahead"), [(0.35, False), (-0.35, True)])
def test_beside_a_proxy_no_sensor_reads_ahead(late: Judgement, delay_s: float, ahead: bool) -> None:
    [delay] = late.findings.findings
    [size] = delay.parameters
    moved = replace(delay, parameters=[replace(size, value=delay_s)])
    assert doubted(late, [moved], matters_s=0.05) == [moved]
    found, _ = doubted(late, [moved, proxy("leak", delay)], matters_s=0.05)
    assert found.named != ahead
    assert [said.startswith("level comes early by 0.35 s") for said in found.caveats] == [True] * ahead
