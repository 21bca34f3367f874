"""A model with what a diagnosis found built in: as a TOML file, and as the baseline of the next diagnosis.

Only effects that were named are applied: a best proxy is not the cause, and of a group whose members cannot be told
apart the best is taken and the others are said. Parameters of the baseline are refitted by every diagnosis and stay.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from bus.user_error import UserError
from diagnosis.apply.toml_text import Line, laid_over
from diagnosis.describe import evidence, rounded
from discrepancy.model.description import Effect, Model, Parameter
from discrepancy.signals.findings import Estimate, Finding, Findings

Values = Mapping[str, Mapping[str, float]]
"""Parameters by effect, in the units of the model."""
FOUND: Final = "# With what `loaderhil diagnose` found:"
BEFORE: Final = "# and what it had found before:"


class BadExtension(UserError, ValueError):
    """The file of an extended model cannot be used; the message says where and why."""


@dataclass(frozen=True, slots=True)
class Applied:
    """A named effect with its values, and what is told of it: the effect in sentences, each value in a few words."""

    effect: str
    kind: str
    values: Mapping[str, float]
    story: Sequence[str]
    told: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The files of an extended model, by path, and what is to be said of them."""

    files: Mapping[Path, str]
    said: Sequence[str]


def applied(result: Findings) -> list[Applied]:
    """What of a diagnosis goes into the model."""
    return [
        Applied(
            f.effect,
            f.kind,
            {e.name: e.value for e in f.parameters},
            _story(f, result.recordings),
            {e.name: _interval(e) for e in f.parameters},
        )
        for f in result.findings
        if f.named
    ]


def not_applied(result: Findings) -> list[str]:
    """What of a diagnosis does not go into the model, and why; one line each."""
    lines = [
        f"{f.effect} is not applied: the best proxy, its cause is unknown ({'; '.join(f.caveats)})"
        for f in result.findings
        if not f.named
    ]
    if result.open_ended is not None:
        lines.append(
            f"not applied: {result.open_ended.equation}; `loaderhil effects add` makes an effect of it"
        )
    return lines


def _story(f: Finding, recordings: Sequence[str]) -> list[str]:
    """Where it was found and on what evidence, as comment lines."""
    where = ", ".join(f"{channel} {share:.0%}" for channel, share in f.where.channels.items() if share > 0.05)
    spans = "; ".join(f"{i.recording} {i.start_s:.1f} to {i.end_s:.1f} s" for i in f.where.intervals[:3])
    lines = [
        f"{f.sentence.rstrip('.')}: {f.equation}".rstrip(": "),
        f"found in {', '.join(recordings)}; seen in {where}, "
        + ("throughout" if f.where.throughout or not spans else f"mostly at {spans}"),
        f"evidence {evidence(f.sse_reduction)} ({f.threshold:.0f} needed), {evidence(f.held_out_sse_reduction)} on held-out data; closes {f.gap_closed:.0%} of the gap",
    ]
    if f.group:
        lines.append(
            f"cannot be told on these recordings from: {', '.join(member.effect for member in f.group)}"
        )
    return lines


def _interval(e: Estimate) -> str:
    unit = "" if e.unit == "1" else f"{e.unit}, "
    if e.low is None or e.high is None:
        return f"{unit}no interval"
    was = f"; was {e.baseline:.4g}" if e.baseline else ""
    low, high = (rounded(v, 0.5 * (e.high - e.low)) for v in (e.low, e.high))
    return f"{unit}95 %: {low} to {high}{was}"


def with_stories(text: str, found: Sequence[Applied], said: Sequence[str]) -> str:
    """The text under comments that say what was found, on what evidence, and what was left out; those of an earlier diagnosis stay."""
    if not found and not said:
        return text
    rows = [FOUND]
    for item in found:
        rows += [f"# {item.effect}:", *(f"#   {line}" for line in item.story)]
    return "\n".join([*rows, *(f"# {line}" for line in said), "#", text.replace(FOUND, BEFORE)])


def extended_text(base: str, found: Sequence[Applied]) -> str:
    """The text of a file with [effects.NAME] tables, with what was found laid over it."""
    lines = [
        Line(("effects", item.effect), name, value, item.told[name])
        for item in found
        for name, value in item.values.items()
    ]
    return laid_over(base, lines)


def plain(model: str) -> str:
    """The text of a file that extends a model by nothing."""
    return (
        f"# Baseline of a diagnosis: loaderhil diagnose RECORDING --with THIS\nmodel = {json.dumps(model)}\n"
    )


def read(path: Path, model: Model) -> Values:
    """The effects of a written file, checked against the model. Raises BadExtension."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise BadExtension(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    except tomllib.TOMLDecodeError as error:
        raise BadExtension(f"{path}: not valid TOML: {error}") from error
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
    """The values of one effect, all of them there, none beyond its bounds."""
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
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadExtension(f"{where} = {value!r} is not a number of {p.unit}")
    if not p.lower <= value <= p.upper:
        raise BadExtension(f"{where} = {value:g} {p.unit} is outside {p.lower:g} to {p.upper:g} {p.unit}")
    return float(value)


def extended(model: Model, values: Values) -> Model:
    """The model whose baseline has these effects; they stay in its library, so that a change of them can be found."""
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
    """The parameter with another baseline; changes that would leave its bounds are tried the other way."""

    def inside(change: float) -> float:
        return change if p.lower <= value + change <= p.upper else -change

    return replace(
        p, value=value, typical=inside(p.typical), trial_steps=tuple(inside(c) for c in p.trial_steps)
    )
