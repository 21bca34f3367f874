"""A verdict does not depend on how often was sampled: small bodies at their finest rate, and every eighth sample of it."""

import pytest

from bench.proof.plan import BODIES
from bench.resampling import resampled
from discrepancy.selection.state import Settings


@pytest.mark.parametrize(
    ("body", "name", "finest", "coarsest"),
    # the straight drive at 200 Hz would cost half a minute (python -m bench.resampling); of every eighth command the car's steering can no longer be estimated
    [
        ("ball", "quadratic drag", 1, 8),
        ("ball", "height lag", 1, 8),
        ("car", "gyro delay", 1, 4),
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
