"""The loader's arms of the proof: random drives through driver, limits, sensors, CAN and ECU, the whole library as candidates."""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from bench import loader_truth
from bench.proof import oracle
from bench.proof.arm import Arm, Truth, diagnosed
from diagnosis.fleet.store import Row
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model
from discrepancy.signals.recording import Recording

SCALES = (0.3, 1.0, 3.0)  # of an effect's typical change


def arms(seeds: int) -> Iterator[Arm]:
    """Nulls, effects, pairs; the plant's own motion by another integrator and MuJoCo's."""
    for drive in loader_truth.arms(seeds=seeds, scales=SCALES):
        kind = ("null", "effect", "pair")[len(drive.effects)]
        body = "mujoco" if drive.truth == "mujoco" else "loader"
        yield Arm(
            body=body,
            kind=kind,
            seed=drive.seed,
            effects=drive.effects,
            # a size and not a lambda: a lambda would cost a search with a whole machine per step
            strength=drive.scale if drive.effects else 0.0,
        )


def carried_out(arm: Arm) -> Row:
    """Drive, record as the bench does, read as the diagnosis does."""
    from discrepancy.models.loader import model as loader

    drive = loader_truth.Arm(
        effects=arm.effects,
        seed=arm.seed,
        scale=arm.strength or 1.0,
        truth="mujoco" if arm.body == "mujoco" else "rk4",
    )
    with tempfile.TemporaryDirectory(prefix="loaderhil-proof-") as folder:
        run = Path(folder) / "run"
        values = loader_truth.record(drive, run)
        recording = loader.load_run(run)
    model = loader.model([recording])
    return diagnosed(arm, model, [recording], _shown(arm, model, recording, values))


def _shown(arm: Arm, model: Model, recording: Recording, values: Mapping[str, float]) -> Truth:
    """What was hidden, with its lambda; an oracle that knows it needs no other candidates."""
    effects = [model.effect(name) for name in arm.effects]
    if not effects:
        return Truth(values=values)
    # only what is hidden: the oracle needs no columns of the other effects
    problem = Problem(replace(model, effects=tuple(effects)), [recording])
    hidden = {p.name: values[p.name] for effect in effects for p in effect.parameters}
    return replace(oracle.measured(problem, effects, hidden), values=values)
