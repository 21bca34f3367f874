"""The result as plain data: what `findings.json` holds (schema in schema.json) and what the terminal words come from.

Units: SI, named beside each value. Gains are differences in whitened SSE, that is twice a log-likelihood ratio.
"""

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter

from discrepancy.recording import Complaint

SCHEMA_VERSION = 1
SCHEMA = Path(__file__).with_name("schema.json")

Status = Literal["explained", "unknown", "nothing missing", "inconclusive"]
Verdict = Literal[
    "found", "confusable with a finding", "ruled out", "negligible", "not needed", "could not be judged"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A fitted parameter with its 95 % interval; `at_bound` names the physical bound it stopped at, `baseline` is where it began."""

    name: str
    value: float
    low: float | None
    high: float | None
    unit: str
    at_bound: str | None = None
    baseline: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupMember:
    """An effect that cannot be told from the finding on these recordings."""

    effect: str
    likelihood_difference: float
    collinearity: float
    parameters: list[Estimate]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A stretch of one recording's own time [s] and the share of the evidence in it."""

    recording: str
    start_s: float
    end_s: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Regime:
    """A range of a signal in which the evidence is denser than on average by `density`."""

    text: str
    share: float
    density: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """Share of the evidence per channel, stretches of time (throughout: none stands out) and regimes."""

    channels: dict[str, float]
    throughout: bool
    intervals: list[Interval]
    regimes: list[Regime]


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """What to drive to tell `effect` from the finding; expected likelihood difference where it was computed."""

    effect: str
    manoeuvre: str
    expected_difference: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One effect. named: the gap is closed, it is the cause; else it is the best proxy and the cause is unknown.

    doubts: why it is not named.
    """

    effect: str
    named: bool
    doubts: list[str]
    kind: Literal["physics", "sensor"]
    place: str
    sentence: str
    equation: str
    parameters: list[Estimate]
    gain: float
    needed: float
    held_out_gain: float
    gap_closed: float
    absorbed: float
    held_out_error: dict[str, float]
    group: list[GroupMember]
    separate_by: list[Separation]
    where: Where


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenTerm:
    """A term of the open-ended equation; equally_good: other terms these recordings cannot tell from it."""

    place: str
    function: str
    coefficient: float
    low: float | None
    high: float | None
    unit: str
    equally_good: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenEquation:
    """What the known signals still explain, outside the library."""

    equation: str
    depends_on: list[str]
    terms: list[OpenTerm]
    gain: float
    needed: float
    held_out_gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One effect of the library in the screen of the baseline. power: chance to have found a typical change.

    noticed_from: the size of which the chance is four in five; empty where no size that can be would be noticed.
    """

    effect: str
    kind: Literal["physics", "sensor"]
    verdict: Verdict
    statistic: float
    p_value: float
    expected: list[Estimate]
    power: float
    absorbed: float
    noticed_from: list[Estimate] = field(default_factory=list)
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """A baseline parameter before and after; prior_sd None: nothing was known."""

    name: str
    unit: str
    before: float
    after: float
    sd: float
    prior_sd: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelNoise:
    """One-step error of a channel at the end, its order of memory, and p of the test that it is white."""

    channel: str
    unit: str
    one_step_error: float
    order: int
    whiteness_p: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WouldShow:
    """An effect, or a pair of rivals: how much it changes a channel (RMS, in its unit), and that over its own movement."""

    what: str
    change: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingChannel:
    """An output without usable samples: effects that it would have shown at their typical size, rivals it would have parted.

    recorded: it was there, and a complaint says why it is of no use.
    """

    channel: str
    unit: str
    recorded: bool = False
    would_judge: list[WouldShow]
    would_part: list[WouldShow]


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """The whole result of one diagnosis."""

    schema_version: int = SCHEMA_VERSION
    model: str
    recordings: list[str]
    baseline: str = ""
    status: Status
    reasons: list[str]
    findings: list[Finding] = field(default_factory=list)
    open_ended: OpenEquation | None = None
    candidates: list[Candidate] = field(default_factory=list)
    nuisances: list[Nuisance] = field(default_factory=list)
    noise: list[ChannelNoise] = field(default_factory=list)
    missing_channels: list[MissingChannel] = field(default_factory=list)
    complaints: list[Complaint] = field(default_factory=list)
    simulations: int = 0
    samples: int = 0

    def finding(self, effect: str) -> Finding:
        """The finding that names `effect` or has it in its group."""
        for found in self.findings:
            if effect in (found.effect, *(m.effect for m in found.group)):
                return found
        raise KeyError(
            f"no finding on {effect!r}; found: {', '.join(f.effect for f in self.findings) or 'nothing'}"
        )

    @property
    def named(self) -> list[str]:
        return [f.effect for f in self.findings if f.named]


_ADAPTER = TypeAdapter(Findings)


def to_json(result: Findings) -> str:
    """JSON text; numbers that do not exist (no interval, infinite bound) become null."""
    return json.dumps(_finite(asdict(result)), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def from_json(text: str) -> Findings:
    """Read and check against the schema; raises pydantic.ValidationError with the place of the fault."""
    return _ADAPTER.validate_json(text)


def schema() -> dict[str, Any]:
    """JSON schema of findings.json, made from the classes above."""
    made = _ADAPTER.json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **made}


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


def schema_text() -> str:
    """The text of schema.json."""
    return json.dumps(schema(), indent=2) + "\n"
