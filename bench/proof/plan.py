"""The plan of the proof: all arms, and the module that carries out each."""

from collections.abc import Iterable, Iterator

from bench.proof import loader, real, thesis
from bench.proof.arm import Arm
from bench.proof.ball import BALL
from bench.proof.body import Body
from bench.proof.car import CAR
from bench.proof.straight import STRAIGHT
from diagnosis.fleet.store import Row

BODIES: dict[str, Body] = {body.name: body for body in (STRAIGHT, BALL, CAR)}
GROUPS = (*BODIES, "loader", "real", "thesis")
PARTS = ("mujoco",)
"""Parts of a group that can be carried out alone: the loader moved by MuJoCo."""
FEWEST_NULLS = 6


def plan(groups: Iterable[str], seeds: int) -> Iterator[Arm]:
    """Every arm of the groups; real recordings only where there are any."""
    for group in groups:
        if group in BODIES:
            yield from BODIES[group].arms(seeds)
        elif group == "loader":
            yield from loader.arms(seeds)
        elif group in PARTS:
            yield from (arm for arm in loader.arms(seeds) if arm.body == group)
        elif group == "real":
            yield from real.arms()
        elif group == "thesis":
            yield from thesis.arms()


def carried_out(arm: Arm) -> Row:
    """Carry out one arm."""
    if arm.body in BODIES:
        return BODIES[arm.body].carried_out(arm)
    return {"loader": loader, "mujoco": loader, "real": real, "thesis": thesis}[arm.body].carried_out(arm)


def sampled(arms: list[Arm], share: float) -> list[Arm]:
    """An even sample of the arms of each body, kind and way of stamping: at least one, and FEWEST_NULLS nulls, because a rate over fewer has no meaning."""
    kept = []
    for sort in dict.fromkeys((a.body, a.kind, a.stamps) for a in arms):
        some = [a for a in arms if (a.body, a.kind, a.stamps) == sort]
        least = FEWEST_NULLS if "null" in sort else 1
        count = min(max(least, round(share * len(some))), len(some))
        # evenly over the plan, not its first arms
        kept += [some[int((i + 0.5) * len(some) / count)] for i in range(count)]
    return kept
