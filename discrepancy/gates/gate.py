"""One test of acceptance with its threshold and where that comes from, for the table in discrepancy.gates and its printed form."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

Object = Literal[
    "recording", "channel", "effect", "temporary effect", "pair", "group", "name", "equation", "verdict"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """One test of acceptance."""

    name: str
    of: Object  # what is tested
    statistic: str  # the number that is compared
    threshold: float  # in the unit of the statistic
    unit: str = ""  # printed after the threshold
    passes: Literal["above", "below"] = "above"  # side of the threshold on which the test is passed
    source: str  # where the threshold comes from
    otherwise: str  # consequence if the test is not passed
    module: str  # modules that apply it, below discrepancy/, separated by commas

    @property
    def modules(self) -> list[str]:
        return self.module.split(", ")


TABLE: Final[list[Gate]] = []
"""All gates, in the order in which they are applied."""


def listed(**fields: object) -> Gate:
    """A new gate, added to the table."""
    gate = Gate(**fields)  # type: ignore[arg-type]
    TABLE.append(gate)
    return gate


def markdown(gates: Iterable[Gate]) -> str:
    """A table of gates, a row each."""
    lines = [
        "| what is tested | test | statistic | passed | threshold from | else | module |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for gate in gates:
        passed = f"{gate.passes} {gate.threshold:g} {gate.unit}".rstrip()
        modules = ", ".join(f"`{module}`" for module in gate.modules)
        cells = (gate.of, gate.name, gate.statistic, passed, gate.source, gate.otherwise, modules)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
