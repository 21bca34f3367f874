"""A verdict does not depend on how often was sampled: small bodies at their finest rate, and every eighth sample of it."""

import pytest

from bench.proof.plan import BODIES
from bench.resampling import Resampled, resampled
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Estimate, Finding, Findings, GroupMember, Where


@pytest.mark.parametrize(
    ("body", "name", "finest", "coarsest"),
    # the straight drive at 200 Hz would cost half a minute (python -m bench.resampling)
    [
        ("ball", "quadratic drag", 1, 8),
        ("ball", "height lag", 1, 8),
        ("car", "gyro delay", 1, 8),
        ("car", "servo lag", 1, 8),
    ],
)
def test_few_and_many_samples_give_the_same_name_and_interval(
    body: str, name: str, finest: int, coarsest: int
) -> None:
    model = BODIES[body].model()
    within = Settings(open_ended=False)
    arm = resampled(body, model, model.effect(name), seed=1, factors=(finest, coarsest), settings=within)
    assert arm.found[finest].named == [name]
    assert arm.same(coarsest)


def verdict(*groups: dict[str, tuple[float, float]]) -> Findings:
    """A finding for each group: its effects with the interval of their parameter, the one that leads first."""
    return Findings(
        model="straight",
        recordings=["drive"],
        status="explained",
        reasons=[],
        findings=[finding(g) for g in groups],
    )


def finding(group: dict[str, tuple[float, float]]) -> Finding:
    estimates = {
        effect: [
            Estimate(
                name=f"{effect}.size", value=(low + high) / 2, low=low, high=high, unit="1", at_bound=None
            )
        ]
        for effect, (low, high) in group.items()
    }
    leader, *others = group
    return Finding(
        effect=leader, named=True, caveats=[], kind="physics", place="", sentence="", equation="",
        parameters=estimates[leader], sse_reduction=100.0, threshold=18.0, held_out_sse_reduction=50.0,
        gap_closed=1.0, confounded_share=0.0, held_out_error={}, separate_by=[],
        group=[
            GroupMember(effect=effect, likelihood_difference=1.0, collinearity=1.0, parameters=estimates[effect])
            for effect in others
        ],
        where=Where(channels={}, throughout=True, intervals=[], regimes=[]),
    )  # fmt: skip


SPEED, ACCELERATION, SLOPE = {"speed": (0.02, 0.03)}, {"acceleration": (-0.03, -0.02)}, {"slope": (1.0, 2.0)}


@pytest.mark.parametrize(
    ("finest", "thinned", "same"),
    [
        ([SPEED], [SPEED], True),
        ([SPEED], [ACCELERATION], False),
        ([SPEED], [{"speed": (0.031, 0.04)}], False),
        ([SPEED | ACCELERATION], [ACCELERATION | SPEED], True),
        ([SPEED | ACCELERATION], [ACCELERATION | {"speed": (0.031, 0.04)}], False),
        ([SPEED | ACCELERATION], [SPEED], False),
        ([SPEED, SLOPE], [SLOPE, SPEED], True),
        ([SPEED], [SPEED, SLOPE], False),
    ],
)
def test_a_verdict_is_the_same_whichever_effect_of_a_group_leads(finest, thinned, same):
    """The group is what is known; the hidden effect's interval counts wherever in the group it stands."""
    arm = Resampled("speed", {1: verdict(*finest), 8: verdict(*thinned)}, 100.0)
    assert arm.same(8) == same
