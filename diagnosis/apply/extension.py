"""A model extended by the effects that a diagnosis named: written as a TOML file, read as the baseline of the next diagnosis.

Only named effects are applied, because a best proxy is not the cause. Of a group that the recordings cannot distinguish, the best member is
applied and the others are listed in a comment. Baseline parameters keep their values, because every diagnosis refits them.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from bus.user_error import UserError
from configuration import ConfigurationError, read_toml
from diagnosis.apply.toml_text import Line, with_values
from diagnosis.describe import evidence, rounded, share
from discrepancy.model.description import Effect, Model, Parameter
from discrepancy.signals.adequacy import STILL_WRONG
from discrepancy.signals.findings import Estimate, Finding, Findings
from discrepancy.signals.quantities import span

Values = Mapping[str, Mapping[str, float]]
"""Parameters by effect, in the units of the model."""
# The first line of the comment of this diagnosis; in a file that is extended again, the older one becomes BEFORE.
FOUND: Final = "# Effects found by `loaderhil diagnose`:"
FORMER_FOUND: Final = "# With what `loaderhil diagnose` found:"  # FOUND in files of version 0.1
BEFORE: Final = "# Effects found by an earlier diagnosis:"


class BadExtension(UserError, ValueError):
    """The file of an extended model cannot be used; the message names file, key and reason."""


@dataclass(frozen=True, slots=True)
class Applied:
    """A named effect that goes into a file."""

    effect: str
    kind: str  # physics or sensor
    values: Mapping[str, float]  # by parameter, in the parameter's unit
    summary: Sequence[str]  # comment lines on the effect and its evidence
    comments: Mapping[str, str] = field(default_factory=dict)  # by parameter: its unit and interval


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of --apply."""

    files: Mapping[Path, str]  # texts by path
    messages: Sequence[str]  # for the terminal: findings that are not in the files, and why


def applied(result: Findings) -> list[Applied]:
    """The effects of a diagnosis that go into the model."""
    return [
        Applied(
            f.effect,
            f.kind,
            {e.name: e.value for e in f.parameters},
            _summary(f, result.recordings),
            {e.name: _interval(e) for e in f.parameters},
        )
        for f in result.findings
        if f.named
    ]


def not_applied(result: Findings) -> list[str]:
    """The findings that do not go into the model, and why; one line each."""
    lines = [
        f"{f.effect} is not applied: it is only the best proxy, the cause is unknown ({'; '.join(f.caveats)})"
        for f in result.findings
        if not f.named
    ]
    if result.open_ended is not None:
        lines.append(
            f"not applied: {result.open_ended.equation}; `loaderhil effects add` writes it as an effect"
        )
    # who reads the file later must know that the extended model is not good enough yet
    beyond = [reason for reason in result.reasons if reason.startswith(STILL_WRONG)]
    return [*lines, *(f"with what is applied, {reason}" for reason in beyond)]


def _summary(f: Finding, recordings: Sequence[str]) -> list[str]:
    """Comment lines: the effect, where its evidence lies, and how strong it is."""
    # channels below 5 % of the evidence would only make the line long
    where = ", ".join(f"{channel} {part:.0%}" for channel, part in f.where.channels.items() if part > 0.05)
    spans = "; ".join(f"{i.recording} {span(i.start_s, i.end_s)}" for i in f.where.intervals[:3])
    lines = [
        f"{f.sentence.rstrip('.')}: {f.equation}".rstrip(": "),
        f"found in {', '.join(recordings)}; seen in {where}, "
        + (
            "throughout"
            if f.where.throughout or not spans
            else f"{'only' if f.where.temporary else 'mostly'} at {spans}"
        ),
        f"evidence {evidence(f.sse_reduction)} (threshold {f.threshold:.0f}), {evidence(f.held_out_sse_reduction)} on held-out data; closes {share(f.gap_closed)} of the gap",
    ]
    if f.group:
        lines.append(
            f"these recordings cannot distinguish it from: {', '.join(member.effect for member in f.group)}"
        )
    return lines


def _interval(e: Estimate) -> str:
    unit = "" if e.unit == "1" else f"{e.unit}, "
    if e.low is None or e.high is None:
        return f"{unit}no interval"
    # a baseline of 0 is the usual "off" and needs no mention
    was = f"; was {e.baseline:.4g}" if e.baseline else ""
    low, high = (rounded(v, 0.5 * (e.high - e.low)) for v in (e.low, e.high))
    return f"{unit}95 %: {low} to {high}{was}"


def with_summaries(text: str, found: Sequence[Applied], messages: Sequence[str]) -> str:
    """The text below comments on the effects found, their evidence, and the findings left out; comments of an earlier diagnosis stay."""
    if not found and not messages:
        return text
    earlier = text.replace(FOUND, BEFORE).replace(FORMER_FOUND, BEFORE)
    rows = [FOUND]
    for item in found:
        rows += [f"# {item.effect}:", *(f"#   {line}" for line in item.summary)]
    return "\n".join([*rows, *(f"# {line}" for line in messages), "#", earlier])


def extended_text(base: str, found: Sequence[Applied]) -> str:
    """The text of a file with the found effects written into its [effects.NAME] tables."""
    lines = [
        Line(("effects", item.effect), name, value, item.comments[name])
        for item in found
        for name, value in item.values.items()
    ]
    return with_values(base, lines)


def plain(model: str) -> str:
    """The text of a file that extends a model by no effect."""
    return (
        f"# Baseline of a diagnosis: loaderhil diagnose RECORDING --with THIS\nmodel = {json.dumps(model)}\n"
    )


def read(path: Path, model: Model) -> Values:
    """The effects in a file that --apply wrote, checked against the model. Raises BadExtension."""
    try:
        tables = read_toml(path)
    except ConfigurationError as error:
        raise BadExtension(str(error)) from error
    named = tables.get("model")
    if named != model.name:
        raise BadExtension(
            f"{path}: model = {named!r}, not {model.name!r}; `diagnose --apply` writes such a file"
        )
    effects = tables.get("effects", {})
    if not isinstance(effects, dict):
        raise BadExtension(f"{path}: effects is not a table of effects")
    return {name: _checked(path, model, name, values) for name, values in effects.items()}


def _checked(path: Path, model: Model, name: str, values: object) -> dict[str, float]:
    """The values of one effect: every parameter must be given, within its bounds. Raises BadExtension."""
    known = {effect.name: effect for effect in model.effects}
    if name not in known:
        raise BadExtension(
            f"{path}: effects.{name}: {model.name} has no such effect; it has {', '.join(known)}"
        )
    if not isinstance(values, dict):
        raise BadExtension(f"{path}: effects.{name} is not a table of parameters")
    parameters = {p.name: p for p in known[name].parameters}
    if strange := [key for key in values if key not in parameters]:
        raise BadExtension(
            f"{path}: effects.{name}.{strange[0]} is not a parameter; it has {', '.join(parameters)}"
        )
    return {
        key: _number(f"{path}: effects.{name}.{key}", values.get(key), p) for key, p in parameters.items()
    }


def _number(where: str, value: object, p: Parameter) -> float:
    # bool is a subclass of int in Python, and `true` is not a size
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadExtension(f"{where} = {value!r} is not a number of {p.unit}")
    try:
        number = float(value)
    # a whole number may have more digits than a float
    except OverflowError as error:
        raise BadExtension(f"{where} has more digits than a number of {p.unit} can have") from error
    if not p.lower <= number <= p.upper:
        raise BadExtension(f"{where} = {number:g} {p.unit} is outside {p.lower:g} to {p.upper:g} {p.unit}")
    return number


def extended(model: Model, values: Values) -> Model:
    """The model whose baseline has these effects. They stay in its library, so that the next diagnosis can find a change of them."""
    return replace(
        model,
        effects=tuple(
            _moved(effect, values[effect.name]) if effect.name in values else effect
            for effect in model.effects
        ),
    )


def _moved(effect: Effect, values: Mapping[str, float]) -> Effect:
    parameters = (_at(p, values[p.name]) if p.name in values else p for p in effect.parameters)
    return replace(effect, parameters=tuple(parameters))


def _at(p: Parameter, value: float) -> Parameter:
    """The parameter with another baseline; trial steps that would leave its bounds change their sign."""

    def inside(change: float) -> float:
        return change if p.lower <= value + change <= p.upper else -change

    return replace(
        p, value=value, typical=inside(p.typical), trial_steps=tuple(inside(c) for c in p.trial_steps)
    )
