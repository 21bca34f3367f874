"""`loaderhil effects add`: writes an open-ended equation of findings.json as a Python file, for a model or for the plant."""

import json
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from diagnosis.apply.functions import Function, NoEffect, read_function
from diagnosis.apply.plant_effect import forces, plant_file
from diagnosis.findings_file import read_findings
from diagnosis.models import NAMED
from discrepancy.model.equations import READING
from discrepancy.signals.findings import Findings, OpenTerm
from plant.effects.files import VARIABLE

NAME = re.compile(
    r"[\w ()-]+"
)  # an effect's name; it is written into Python code, so quotes and line ends are refused


def terms_of(result: Findings, path: Path) -> list[OpenTerm]:
    """The terms of the open-ended equation. Raises NoEffect where there is none."""
    if result.open_ended is None:
        named = (
            f" It names {', '.join(result.named)}: `diagnose --apply` adds named effects to a model."
            if result.named
            else ""
        )
        raise NoEffect(f"{path}: has no open-ended equation beside the library of {result.model}.{named}")
    return result.open_ended.terms


def model_file(result: Findings, terms: Sequence[OpenTerm], name: str, base: str, out: Path) -> str:
    """Text of a FILE.py for `diagnose --model`: the base model (name or file) with the equation as an effect. Raises NoEffect."""
    functions = [read_function(term.function) for term in terms]
    assert result.open_ended is not None
    places = dict.fromkeys(term.place for term in terms)
    # a term at a reading and one at a port together cannot be a fault of sensors alone
    kind = "sensor" if all(place.startswith(READING) for place in places) else "physics"
    text = " ".join(f.arrays for f in functions)
    # only names that are used: the file is meant to be read, and a linter of its owner would complain of the rest
    operators = [name for name in ("lagged", "play") if f"{name}(" in text]
    used = ["Effect", "Parameter", *operators, "with_effect"]
    imports = [
        *(["import numpy as np", ""] if "np." in text else []),
        f"from discrepancy.model import {', '.join(used)}",
        "from diagnosis.models import find_model",
    ]
    file = Path(base)
    here = file.suffix == ".py"
    # relative to the new file: both may move together, and no path of this machine stands in the file
    base_text = (
        f"str(Path(__file__).parent / {json.dumps(os.path.relpath(file, out.parent))})"
        if here
        else json.dumps(base)
    )
    return "\n".join(
        [
            f'"""{name}: found by `loaderhil diagnose` in {", ".join(result.recordings)}, outside the library of {result.model}.',
            "",
            f"    {result.open_ended.equation}",
            "",
            "    loaderhil diagnose RECORDING --model THIS",
            '"""',
            "",
            *(["from pathlib import Path", ""] if here else []),
            *imports,
            "",
            f"BASE = find_model({base_text})",
            "",
            *_effect(result, terms, name, kind, places),
            *(line for place in places for line in _place(place, name, terms, functions)),
            "",
            "native = BASE.native  # its published data sets are read as before",
            "",
            "",
            "def model(recordings):",
            f'    """The model {result.model} with this effect in its library."""',
            f"    terms = {{{', '.join(f'{json.dumps(p, ensure_ascii=False)}: {_identifier(p)}' for p in places)}}}",
            "    return with_effect(BASE.build(recordings), EFFECT, terms)",
            "",
        ]
    )


def written(findings: Path, name: str, base: str | None, out: Path) -> tuple[str, str]:
    """Text of the effect's file, and a sentence on how to use it. Raises NoEffect."""
    if out.suffix != ".py":
        raise NoEffect(f"--out {out}: must end in .py")
    if not NAME.fullmatch(name):
        raise NoEffect(f"--name '{name}': must be of letters, digits, spaces, '_', '-' and brackets")
    file = findings / "findings.json" if findings.is_dir() else findings
    result = read_findings(file)
    terms = terms_of(result, file)
    # A force of the plant is of more use than a term of the diagnosis: the bench can then run with it.
    if result.model == "loader" and base is None and forces(terms):
        use = f"loaderhil effects {name}, with {VARIABLE}={out.parent.resolve()}: makes it available to machine files, run and diagnose"
        return plant_file(result, terms, name), use
    diagnosed = base or result.model
    if diagnosed not in NAMED and not Path(diagnosed).is_file():
        raise NoEffect(
            f"{file}: belongs to the model {result.model}, which is not one of loaderhil's; name its file by --model FILE.py"
        )
    use = f"available to the diagnosis: loaderhil diagnose RECORDING --model {out}"
    return model_file(result, terms, name, diagnosed, out), use


def _effect(
    result: Findings, terms: Sequence[OpenTerm], name: str, kind: str, places: Iterable[str]
) -> list[str]:
    """Lines of the Effect: one parameter per coefficient; the found value is its typical change, so that the screen tries that size."""
    assert result.open_ended is not None
    depends = ", ".join(result.open_ended.depends_on) or "nothing that is known"
    equation = "; ".join(f"{t.place} += c{i} {t.function}" for i, t in enumerate(terms, 1))
    rows = [
        f'        Parameter(name="{name}.c{i}", unit="{t.unit}", typical={t.coefficient!r}),{_interval(t)}'
        for i, t in enumerate(terms, 1)
    ]
    return [
        "EFFECT = Effect(",
        f"    name={json.dumps(name, ensure_ascii=False)},",
        f"    sentence={json.dumps(f'something that depends on {depends}', ensure_ascii=False)},",
        f"    equation={json.dumps(equation, ensure_ascii=False)},",
        "    parameters=(",
        *rows,
        "    ),",
        f'    kind="{kind}",',
        f"    place={json.dumps(', '.join(places), ensure_ascii=False)},",
        f"    excited_by={json.dumps(f'large changes of {depends}', ensure_ascii=False)},",
        ")",
        "",
    ]


def _interval(term: OpenTerm) -> str:
    return "" if term.low is None or term.high is None else f"  # 95 %: {term.low:.4g} to {term.high:.4g}"


def _place(place: str, name: str, terms: Sequence[OpenTerm], functions: Sequence[Function]) -> list[str]:
    # terms at the same place are one sum, because a place takes one function
    added = [
        f'values["{name}.c{i}"] * {f.arrays}'
        for i, (term, f) in enumerate(zip(terms, functions, strict=True), 1)
        if term.place == place
    ]
    return [
        "",
        f"def {_identifier(place)}(s, values, step):",
        f'    """What is added at {place}."""',
        f"    return {' + '.join(added)}",
        "",
    ]


def _identifier(place: str) -> str:
    return "at_" + "".join(letter if letter.isalnum() else "_" for letter in place)
