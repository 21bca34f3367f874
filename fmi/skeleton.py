"""Shows what an FMU offers, and writes a commented companion file from it. The file changes nothing until its author edits it."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

from fmi.companion import Companion, Fitted
from fmi.description import Description, Variable
from fmi.model import read_model


def lines_of(file: Path) -> Iterator[str]:
    """The FMU in lines for the terminal: its variables with unit, start value, bounds and their use without a companion. Raises FmuError."""
    found = read_model(file)
    d, c = found.description, found.companion
    by = f", made by {d.tool}" if d.tool else ""
    yield f"{file.name}: {d.name}, FMI {d.version}.0 co-simulation{by}"
    yield d.sentence
    for title, variables in (
        ("inputs", d.named("input")),
        ("outputs", d.named("output")),
        ("parameters", d.named("parameter")),
    ):
        yield f"{title}:" if variables else f"{title}: none"
        yield from (f"  {_line(v, c)}" for v in variables)
    if d.states:
        yield f"continuous states: {', '.join(d.states)}"
    yield from (f"note: {note}" for note in c.notes)
    yield from (f"against the standard: {problem}" for problem in _problems(file))


def _problems(file: Path) -> list[str]:
    """What FMPy's validation says, one line each; tools break the standard in places that do not matter here."""
    from fmpy.validation import validate_fmu

    return [" ".join(problem.split()) for problem in validate_fmu(str(file))]


def _line(v: Variable, companion: Companion) -> str:
    parts = [v.name, f"[{v.unit or '1'}]"]
    if v.start is not None:
        parts.append(f"start {v.start:g}")
    if math.isfinite(v.lower) or math.isfinite(v.upper):
        parts.append(f"{v.lower:g} to {v.upper:g}")
    parts += [f"({use})"] if (use := _use(v, companion)) else []
    return " ".join(parts) + (f": {v.sentence}" if v.sentence else "")


def _use(v: Variable, c: Companion) -> str:
    if any(p.variable is v for e in c.effects for p in e.parameters):
        return "effect"
    for p in c.parameters:
        if p.variable is v:
            return "initial state, fitted in each window" if p.initial else "fitted"
    return "not fitted" if v.causality == "parameter" else ""


def companion_text(file: Path) -> str:
    """A companion file that states the defaults, with what else can be said as comments. Raises FmuError."""
    found = read_model(file)
    d, c = found.description, found.companion
    initial, fitted = [p for p in c.parameters if p.initial], [p for p in c.parameters if not p.initial]
    used = {p.variable.name for p in (*c.parameters, *(p for e in c.effects for p in e.parameters))}
    left = [v for v in d.named("parameter") if v.name not in used]
    return "\n".join(
        [
            f"# What the diagnosis cannot know from {file.name}. Numbers are in the units of the FMU.",
            f"# loaderhil diagnose RECORDING --model {file.name} reads this file if it lies beside the FMU.",
            f"sentence = {_quoted(d.sentence)}",
            *([] if d.step_s is None else [f"step_s = {d.step_s:g}  # of the grid"]),
            "# window_s = 20.0  # length of a window; without it a recording is one window",
            "",
            *_channels(d),
            "# Parameters that are refitted in every comparison. prior_sd: standard deviation of what is known of them.",
            "[parameters]" if not fitted else "",
            *(line for p in fitted for line in _fitted("parameters", p)),
            "# Initial states, refitted in every window; guess: the output from whose first value the fit starts.",
            "[initial]" if not initial else "",
            *(line for p in initial for line in _fitted("initial", p)),
            "# Effects: parameters at whose value nothing happens. typical: the smallest change that matters.",
            "[effects]" if not c.effects else "",
            *(line for e in c.effects for line in (*_fitted("effects", e.parameters[0], e.sentence),)),
            *(f"# not used: {v.name} [{v.unit or '1'}], start {v.start}" for v in left),
            "",
        ]
    )


def _channels(d: Description) -> Iterator[str]:
    for v in d.named("input"):
        yield f"[inputs.{_key(v.name)}]  # {v.unit or '1'}{_after(v)}"
        yield '# column = "NAME"  # in recordings, where it differs'
        yield "# held = true  # the value holds until the next one; else it is linear in between"
        yield "# port = 0.0  # size of what may be added to it; 0: nothing is"
        yield ""
    for v in d.named("output"):
        yield f"[outputs.{_key(v.name)}]  # {v.unit or '1'}{_after(v)}"
        yield '# faults = ["bias", "scale", "delay", "lag"]  # of its sensor; also sign and drift'
        yield "# bias = 0.0  # an offset that matters"
        yield "# noise = 0.0  # standard deviation, from the sensor's sheet"
        yield ""


def _fitted(table: str, p: Fitted, sentence: str = "") -> Iterator[str]:
    yield f"[{table}.{_key(p.variable.name)}]  # {p.variable.unit or '1'}{_after(p.variable)}"
    if sentence:
        yield f"sentence = {_quoted(sentence)}"
    yield f"value = {float(p.value)!r}"
    yield f"typical = {float(p.typical):.6g}"
    for key, number in (("lower", p.lower), ("upper", p.upper), ("prior_sd", p.prior_sd)):
        if number is not None and math.isfinite(number):
            yield f"{key} = {float(number):.6g}"
    if p.guess:
        yield f"guess = {_quoted(p.guess)}"
    yield ""


def _after(v: Variable) -> str:
    return f"; {v.sentence}" if v.sentence else ""


def _key(name: str) -> str:
    """A name as a key of TOML: 'tank.h' would be two keys."""
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else _quoted(name)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
