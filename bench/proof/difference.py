"""What a wild arm's truth has that the model lacks, drawn by chance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.proof.arm import Arm

Range = tuple[float, float]
AT_ONCE = 2  # of one drive


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One way in which a real machine is not as the model says."""

    name: str
    ranges: Mapping[str, Range]  # of the truth's parameters, least and most; drawn evenly in the logarithm
    fair: tuple[str, ...] = ()  # effects of the library that are a fair name for it


def names(possible: Sequence[Difference], seed: int, hidden: tuple[str, ...]) -> str:
    """Two of them by chance, joined for `Arm.what`; none that is nearly what is hidden, which would leave nobody knowing what is there."""
    apart = [d for d in possible if not set(d.fair) & set(hidden)]
    rng = np.random.default_rng([seed, 5])
    return " + ".join(apart[i].name for i in sorted(rng.choice(len(apart), AT_ONCE, replace=False)))


def chosen(arm: Arm, possible: Sequence[Difference]) -> list[Difference]:
    """Those that the arm's truth has."""
    of = {d.name: d for d in possible}
    return [of[name] for name in arm.what.split(" + ") if name]


def drawn(arm: Arm, possible: Sequence[Difference]) -> dict[str, float]:
    """The parameters of the arm's differences."""
    rng = np.random.default_rng([arm.seed, 6])
    return {
        name: float(low * (high / low) ** rng.random())
        for d in chosen(arm, possible)
        for name, (low, high) in d.ranges.items()
    }
