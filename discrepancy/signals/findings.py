"""The result of a diagnosis as plain data: the content of `findings.json` (schema in schema.json), for terminal, page and programs.

Units are SI and stand beside each value. A reduction of the SSE is a difference of squared whitened errors, twice a log-likelihood ratio.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import TypeAdapter

from discrepancy.signals.adequacy import ChannelAdequacy
from discrepancy.signals.recording import Complaint

SCHEMA_VERSION = 4
READABLE: Final = (1, 2, 3)  # versions that are still read
SCHEMA = Path(__file__).with_name("schema.json")
RENAMED: Final[Mapping[int, Mapping[str, str]]] = {
    2: {
        "gain": "sse_reduction",
        "needed": "threshold",
        "held_out_gain": "held_out_sse_reduction",
        "doubts": "caveats",
        "absorbed": "confounded_share",
        "noticed_from": "smallest_detectable",
    },
    4: {"would_part": "would_distinguish"},
}
"""Fields that have another name since a version: before and now."""
BY_CHANNEL: Final = ("channels", "held_out_error")  # mappings whose keys are no fields

Status = Literal["explained", "explained in part", "unknown", "nothing missing", "inconclusive"]
LESS_SURE: Final[Mapping[Status, Status]] = {"explained": "explained in part", "nothing missing": "unknown"}
"""What a status becomes where something is not understood; the others stay."""
Verdict = Literal[
    "found", "confusable with a finding", "ruled out", "negligible", "not needed", "could not be judged"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A fitted parameter with its 95 % interval."""

    name: str
    value: float
    low: float | None
    high: float | None
    unit: str
    at_bound: str | None = None  # lower or upper: the physical bound at which it stopped
    baseline: float | None = None  # its value in the model as it was given

    def overlaps(self, other: "Estimate") -> bool:
        """Whether the intervals have a value in common; an end that is not known is beyond everything."""
        return _reaches(self.low, other.high) and _reaches(other.low, self.high)


def _reaches(low: float | None, high: float | None) -> bool:
    return low is None or high is None or low <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupMember:
    """An effect that these recordings cannot distinguish from the finding."""

    effect: str
    likelihood_difference: float  # in SSE, from the finding
    collinearity: float  # cosine with the finding, beyond the nuisances
    parameters: list[Estimate]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """An interval of one recording's own time and the share of the evidence in it."""

    recording: str
    start_s: float
    end_s: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Regime:
    """A range of a signal in which the evidence is denser than on average."""

    text: str
    share: float  # of the evidence
    density: float  # times the average


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """Where the evidence of a finding lies."""

    channels: dict[str, float]  # share of the evidence, largest first
    throughout: bool  # no interval stands out
    intervals: list[Interval]
    regimes: list[Regime]
    # the effect acts in the intervals only; else they are where most of its evidence happens to be
    temporary: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """What to drive to distinguish `effect` from the finding."""

    effect: str
    manoeuvre: str
    expected_difference: float | None  # in SSE, where it was computed


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One effect that the data need."""

    effect: str
    named: bool  # it is the cause; else it is the best proxy and the cause is unknown
    caveats: list[str]  # why it is not named
    kind: Literal["physics", "sensor"]
    place: str
    sentence: str
    equation: str
    parameters: list[Estimate]
    sse_reduction: float  # beside all other findings
    threshold: float  # of the reduction
    held_out_sse_reduction: float
    gap_closed: float  # share of the held-out gap to the best that anything reaches
    confounded_share: float  # of the effect, that the nuisances can do
    held_out_error: dict[str, float]  # by channel: error with it over error without it
    group: list[GroupMember]
    separate_by: list[Separation]
    where: Where

    @property
    def members(self) -> tuple[str, ...]:
        """All effects that these recordings cannot distinguish, the finding's own first."""
        return (self.effect, *(member.effect for member in self.group))


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenTerm:
    """A term of the open-ended equation."""

    place: str  # a port of the model, or 'reading of OUTPUT'
    function: str
    coefficient: float
    low: float | None
    high: float | None
    unit: str  # of the coefficient
    equally_good: list[str]  # other terms that these recordings cannot distinguish from it


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenEquation:
    """What the known signals still explain, outside the library."""

    equation: str
    depends_on: list[str]
    terms: list[OpenTerm]
    sse_reduction: float
    threshold: float
    held_out_sse_reduction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One effect of the library in the screen of the baseline, and what became of it."""

    effect: str
    kind: Literal["physics", "sensor"]
    verdict: Verdict
    statistic: float
    p_value: float
    expected: list[Estimate]
    power: float  # chance to find a change of typical size
    confounded_share: float  # of the effect, that the nuisances can do
    smallest_detectable: list[Estimate] = field(
        default_factory=list
    )  # found with 80 % power; empty: no possible size is
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """A baseline parameter before and after."""

    name: str
    unit: str
    before: float
    after: float
    sd: float
    prior_sd: float | None  # None: nothing was known


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineValue:
    """A finding of kind parameter: a value of the baseline that the recordings contradict."""

    estimate: Estimate  # its baseline is the assumed value
    prior_sd: float  # of the assumed value
    away: float  # of the estimate from the assumed value, in standard deviations of the prior
    sure: bool  # all channels are adequate, the interval does not hold what the prior allows, and nothing else may act in its place
    or_effects: list[str] = field(default_factory=list)  # that the recordings cannot distinguish from it
    kind: Literal["parameter"] = "parameter"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelNoise:
    """What is left of a channel at the end."""

    channel: str
    unit: str
    one_step_error: float
    order: int  # samples that the noise remembers
    whiteness_p: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WouldShow:
    """An effect, or a pair of rivals, in a channel that was not recorded."""

    what: str
    change: float  # of the channel, root mean square, in its unit
    share: float  # of the channel's own movement


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingChannel:
    """An output without usable samples."""

    channel: str
    unit: str
    recorded: bool = False  # it was there, and a complaint says why it is of no use
    would_judge: list[WouldShow]  # effects that it would have shown at their typical size
    would_distinguish: list[WouldShow]  # pairs of effects, confusable here, that it would have distinguished


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """The whole result of one diagnosis."""

    schema_version: int = SCHEMA_VERSION
    model: str
    recordings: list[str]
    baseline: str = ""
    status: Status
    reasons: list[str]
    cut_short: bool = False  # the search ended at its time limit, before other explanations had been tried
    findings: list[Finding] = field(default_factory=list)
    adequacy: list[ChannelAdequacy] = field(default_factory=list)  # by channel; empty in files of version 2
    open_ended: OpenEquation | None = None
    candidates: list[Candidate] = field(default_factory=list)
    baseline_values: list[BaselineValue] = field(default_factory=list)  # furthest from its prior first
    nuisances: list[Nuisance] = field(default_factory=list)
    noise: list[ChannelNoise] = field(default_factory=list)
    missing_channels: list[MissingChannel] = field(default_factory=list)
    complaints: list[Complaint] = field(default_factory=list)
    simulations: int = 0
    samples: int = 0

    def finding(self, effect: str) -> Finding:
        """The finding that names `effect` or has it in its group."""
        for found in self.findings:
            if effect in found.members:
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
    """Read and check against the schema; files of an earlier version are read by the names of their time.

    Files of versions 1 and 2 know no adequacy: theirs is an empty list.

    Raises pydantic.ValidationError with the place of the fault.
    """
    try:
        raw = json.loads(text)
    except ValueError:
        return _ADAPTER.validate_json(text)  # says where
    if isinstance(raw, dict) and raw.get("schema_version") in READABLE:
        changed = [names for version, names in RENAMED.items() if version > raw["schema_version"]]
        since = {old: new for names in changed for old, new in names.items()}
        raw = _renamed(raw, since) | {"schema_version": SCHEMA_VERSION}
    return _ADAPTER.validate_json(json.dumps(raw))


def _renamed(value: Any, names: Mapping[str, str]) -> Any:
    """The content of an earlier file with the names of today; names: those that have changed since."""
    if isinstance(value, dict):
        # A channel may have the name of a field: mappings by channel stay as they are.
        return {
            names.get(key, key): item if key in BY_CHANNEL else _renamed(item, names)
            for key, item in value.items()
        }
    return [_renamed(item, names) for item in value] if isinstance(value, list) else value


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
