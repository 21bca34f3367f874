"""The thesis' printed estimators diagnosed against the plant, on drives through CAN as studies.thesis makes them."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from bench.proof.arm import Arm, Truth, row
from diagnosis.fleet.store import Row
from studies.thesis.left_out import EXPECTED, OTHERS, diagnose, record

FIRST = (4, 0.0)
"""Seed of the sensors' noise and payload [kg] of the drive that the thesis page shows."""
TAKEN_OUT = ("pivot arm", "centripetal")


def arms() -> Iterator[Arm]:
    """Every drive with the whole library, and the first without its two right answers."""
    for seed, payload in (FIRST, *OTHERS):
        yield Arm(
            body="thesis",
            kind="real",
            seed=seed,
            strength=payload,
            what=f"printed estimators, {payload:.0f} kg, seed {seed}",
        )
    yield Arm(
        body="thesis",
        kind="real",
        seed=FIRST[0],
        what=f"the same without {' and '.join(TAKEN_OUT)} in the library",
    )


def carried_out(arm: Arm) -> Row:
    """Drive, record through CAN, diagnose with the print as the model."""
    without = TAKEN_OUT if "without" in arm.what else ()
    with tempfile.TemporaryDirectory(prefix="loaderhil-proof-") as folder:
        run = record(Path(folder) / "run", arm.seed, arm.strength)
        start = time.perf_counter()
        found = diagnose(run, without=without).findings
    # without the right answers in the library only something near can be named, and no name is right
    expected = f"{', '.join(EXPECTED)}; none else" if not without else "the nearest things left"
    return row(arm, Truth(beyond={"expected": expected}), found, time.perf_counter() - start)
