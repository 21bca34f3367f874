"""A few arms of the loader's proof, so that its page cannot grow old unseen: drives in which an ECU limits the levers, of both truths."""

import pytest

from bench.proof import loader, score
from bench.proof.arm import read


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "kind", "effects", "seed"),
    [
        ("loader", "null", (), 1400),
        ("mujoco", "null", (), 1000),
        ("mujoco", "effect", ("yaw_rate lag",), 1035),
    ],
)
def test_an_arm_of_the_proof_has_its_verdict(body, kind, effects, seed):
    [arm] = [
        a
        for a in loader.arms(1)
        if (a.body, a.kind, a.effects, a.seed) == (body, kind, effects, seed) and a.strength in (0.0, 1.0)
    ]
    done = read(loader.carried_out(arm))
    if effects:
        assert score.found(done), done.findings.reasons
    else:
        assert done.findings.status == "nothing missing", done.findings.reasons
        assert done.findings.findings == []
