"""One arm of the proof: what is hidden in which body of truth, and the row that is kept of its diagnosis."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from diagnosis.fleet.store import Row
from discrepancy.examine import examine
from discrepancy.model.description import Model
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings, from_json, to_json
from discrepancy.signals.recording import Recording

LOADERS = (
    "loader",
    "mujoco",
    "wild loader",
)  # bodies with a whole machine; their effects have a size, and the lambda they come to
# From 10, at which no method detects reliably (docs/nomenclature.md), to 2500, which a plot of residuals shows.
LAMBDAS = (10.0, 20.0, 50.0, 250.0, 2500.0)
STRONG = 50.0  # from here on the truth has to be found
EXACT = 250.0  # from here on with its size
NEAR = (
    0.8,
    1.5,
)  # of the wanted lambda; an effect beyond, because of its bound or of a start far from it, counts in no row of that lambda


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One recording of the proof, with what is hidden in it."""

    body: str  # of truth
    # null, effect, outside (no effect of the library is the cause), pair, interval (acts between start_s and end_s only), real
    kind: str
    seed: int
    effects: tuple[str, ...] = ()
    noise: str = ""
    # wanted lambda; infinite: the effect has one size only. For the loader: the size in typical changes.
    strength: float = 0.0
    what: str = ""  # name of the case where no effect of the library is hidden
    start_s: float | None = None
    end_s: float | None = None
    stamps: str = ""  # of bench.proof.stamps.KINDS; empty: on the model's grid

    @property
    def key(self) -> str:
        """Unique, and fit for a file."""
        hidden = "+".join(self.effects) or self.what
        parts = (
            self.body,
            self.kind,
            hidden,
            self.noise,
            self.stamps,
            f"{self.strength:g}" if self.strength else "",
            str(self.seed),
        )
        # a slash would make a folder of the file's name
        return " ".join(part for part in parts if part).replace("/", "-")


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What an arm hid, and how visible it is."""

    values: Mapping[str, float] = field(default_factory=dict)  # true parameters
    reached: float | None = None  # lambda on this recording
    # of a wild arm, whose lambda is that without its differences: lambda beside them
    beside: float | None = None
    channels: Mapping[str, float] = field(default_factory=dict)  # share of lambda per channel
    beyond: Mapping[str, str] = field(
        default_factory=dict
    )  # further results to keep, such as a peer's answer


@dataclass(frozen=True, slots=True)
class Done:
    """A row read back."""

    arm: Arm
    truth: Truth
    findings: Findings
    seconds: float

    @property
    def named(self) -> list[str]:
        return self.findings.named

    def group_has(self, effect: str) -> bool:
        """Whether a named finding is the effect or has it in its group."""
        return any(effect in f.members for f in self.findings.findings if f.named)

    @property
    def reached(self) -> bool:
        """Whether the effect is as strong as was wanted."""
        if np.isinf(self.arm.strength):
            return True
        low, high = (share * self.arm.strength for share in NEAR)
        # None: it was not measured
        return self.truth.reached is None or low <= self.truth.reached <= high

    @property
    def lam(self) -> float:
        """The lambda with which the arm counts: the wanted one if it was reached; for the loader the measured one."""
        if self.arm.body in LOADERS:
            return self.truth.reached or 0.0
        return self.arm.strength if self.reached else 0.0


def diagnosed(arm: Arm, model: Model, recordings: list[Recording], truth: Truth) -> Row:
    """Diagnose and make the row."""
    start = time.perf_counter()
    found = examine(model, recordings, Settings())
    return row(arm, truth, found, time.perf_counter() - start)


def row(arm: Arm, truth: Truth, found: Findings, seconds: float) -> Row:
    """The row that is stored: columns for a reader, and everything as JSON."""
    return {
        "body": arm.body,
        "kind": arm.kind,
        "effects": ", ".join(arm.effects) or arm.what,
        "noise": arm.noise,
        "strength": arm.strength,
        "reached": truth.reached,
        "beside": truth.beside,
        "seed": arm.seed,
        "start_s": arm.start_s,
        "end_s": arm.end_s,
        "stamps": arm.stamps,
        "what": arm.what,
        "status": found.status,
        "named": ", ".join(found.named),
        "seconds": seconds,
        "simulations": found.simulations,
        "truth": json.dumps(dict(truth.values)),
        "channels": json.dumps(dict(truth.channels)),
        "beyond": json.dumps(dict(truth.beyond)),
        # beside the readable column: names of effects may hold a comma
        "hidden": json.dumps(arm.effects),
        "findings": to_json(found),
    }


def read(kept: Row) -> Done:
    """A row as it was made."""
    arm = Arm(
        body=str(kept["body"]),
        kind=str(kept["kind"]),
        seed=int(kept["seed"] or 0),
        effects=tuple(json.loads(str(kept["hidden"]))),
        noise=str(kept["noise"]),
        strength=float(kept["strength"] or 0.0),
        what=str(kept["what"]),
        start_s=_number(kept["start_s"]),
        end_s=_number(kept["end_s"]),
        stamps=str(kept.get("stamps") or ""),
    )
    truth = Truth(
        values=json.loads(str(kept["truth"])),
        reached=_number(kept["reached"]),
        beside=_number(kept.get("beside")),
        channels=json.loads(str(kept["channels"])),
        beyond=json.loads(str(kept["beyond"])),
    )
    return Done(arm, truth, from_json(str(kept["findings"])), float(kept["seconds"] or 0.0))


def _number(value) -> float | None:
    return None if value is None else float(value)
