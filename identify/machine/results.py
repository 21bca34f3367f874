"""Results of an identification from drives: lines for the terminal, identification.json, and a machine with its equipment."""

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from diagnosis.apply.toml_text import Line, with_values
from diagnosis.describe import rounded
from discrepancy.signals.adequacy import left
from hil.companions import EQUIPMENT, companion, named
from identify.ends import NORMAL_95, ProfileInterval
from identify.machine.balances import BODY_VALUES
from identify.machine.drives import Estimated, Identified
from identify.machine.parameters import PAYLOAD, machine_lines, sensor_entry
from identify.machine.programme import Programme
from plant.sheets.machine import MACHINES
from plant.unit.equipment import FOLDER, load_equipment

Profiles = Mapping[str, ProfileInterval]


def summary(e: Estimated) -> str:
    """'identified, 95 % 6120 to 6257; sheet 6018; posterior/prior sd 0.29'."""
    low, high = interval_text(e)
    word = "identified" if e.status == "determined" else e.status
    return f"{word}, 95 % {low} to {high}; sheet {e.sheet:.5g}; posterior/prior sd {e.remaining:.2f}"


def _named(e: Estimated) -> str:
    """The summary of a quantity that is not the key's own: its name and unit come first."""
    return f"{e.quantity.label} [{e.quantity.unit}]: {summary(e)}"


def interval_text(e: Estimated) -> tuple[str, str]:
    """Both ends, as many digits as their distance deserves."""
    half = 0.5 * (e.upper - e.lower)
    return rounded(e.lower, half), rounded(e.upper, half)


def warnings(found: Identified) -> Iterator[str]:
    """What a reader has to know before using a value."""
    if found.inadequate:
        yield (
            "the model does not describe these drives, so the intervals are not to be trusted; find what is missing first: "
            "loaderhil diagnose RUN... --model loader"
        )
    for c in found.inadequate:
        yield left(c, several=len(found.recordings) > 1)
    for e in found.estimates:
        if e.conflict:
            yield (
                f"{e.quantity.label} lies {e.off_sheet:.1f} standard deviations of the prior from the sheet: a wrong sheet, or physics that the "
                "model lacks (loaderhil diagnose)"
            )
    for complaint in found.complaints:
        yield complaint.described


def together(found: Identified) -> Iterator[str]:
    """One sentence for each pair of which only a combination is determined."""
    for p in found.pairs:
        yield (
            f"{p.first.label} and {p.second.label} are determined only together (correlation {p.correlation:+.2f}): {p.slope:+.3g} "
            f"{p.second.unit} of the second for 1 {p.first.unit} of the first, with ± {NORMAL_95 * p.rest_sd:.2g} {p.second.unit} left"
        )


def undetermined(found: Identified) -> Iterator[str]:
    """Names of quantities that the drives have hardly narrowed."""
    for e in found.estimates:
        if e.status == "not determined":
            yield f"{e.quantity.label}: as wide as its prior ({e.remaining:.2f} of it)"


def programme_lines(found: Identified, programme: Programme) -> Iterator[str]:
    """The programme in sentences: each drive, with what it leaves."""
    label = {q.parameter: q.label for q in found.quantities}
    if not programme.now:
        yield f"every parameter is known to {programme.target:g} of its prior's standard deviation or better: no further drive is needed"
        return
    if programme.steps:
        yield f"shortest drive programme, {programme.duration_s:g} s (posterior over prior standard deviation, target {programme.target:g}):"
        yield f"  {'now':24}" + _shares(programme.now)
        for step in programme.steps:
            yield f"  {f'{step.drive.name}, {step.drive.duration_s:g} s':24}" + _shares(step.remaining)
    else:
        yield "no scenario of the bench brings an open parameter to the target"
    for name in programme.beyond:
        advice = (
            ": weigh the machine articulated and on a grade, or one frame alone"
            if name in BODY_VALUES
            else ""
        )
        yield f"beyond every programme of the bench's scenarios: {label[name]}{advice}"
    for text in programme.left_out:
        yield f"not considered: {text}"


def _shares(remaining: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {share:.2f}" for name, share in remaining.items())


def as_json(found: Identified, profiles: Profiles, programme: Programme | None, origin: str) -> str:
    """The text of identification.json, for programs."""
    content = {
        "origin": origin,
        "machine": found.machine.name,
        "recordings": list(found.recordings),
        "adequate": not found.inadequate,
        "parameters": {e.quantity.parameter: _parameter(e, profiles) for e in found.estimates},
        "sums": {
            name: {"value": v, "unit": unit, "lower": v - NORMAL_95 * sd, "upper": v + NORMAL_95 * sd}
            for name, unit, v, sd in found.sums
        },
        "together": [
            {
                "first": p.first.parameter,
                "second": p.second.parameter,
                "correlation": p.correlation,
                "slope": p.slope,
                "rest_sd": p.rest_sd,
            }
            for p in found.pairs
        ],
        "channels": {
            c.channel: {
                "unit": c.unit,
                "one_step": c.one_step,
                "simulated": c.simulated,
                "budget": c.simulated_budget,
                "adequate": c.adequate,
            }
            for c in found.channels
        },
        "programme": None if programme is None else _programme(programme),
        "warnings": list(warnings(found)),
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _parameter(e: Estimated, profiles: Profiles) -> dict[str, object]:
    p = profiles.get(e.quantity.parameter)
    value = e.quantity.value
    by_profile = (
        None
        if p is None
        else {"lower": value(p.lower), "upper": value(p.upper), "linear": [value(v) for v in p.linear]}
    )
    return {
        "label": e.quantity.label,
        "unit": e.quantity.unit,
        "value": e.value,
        "lower": e.lower,
        "upper": e.upper,
        "sheet": e.sheet,
        "prior": list(e.prior) if math.isfinite(e.prior[1] - e.prior[0]) else None,
        "posterior_over_prior_sd": e.remaining,
        "status": e.status,
        "profile": by_profile,
    }


def _programme(p: Programme) -> dict[str, object]:
    return {
        "target": p.target,
        "now": dict(p.now),
        "drives": [
            {
                "scenario": s.drive.name,
                "duration_s": s.drive.duration_s,
                "posterior_over_prior_sd": dict(s.remaining),
            }
            for s in p.steps
        ],
        "duration_s": p.duration_s,
        "beyond": list(p.beyond),
        "left_out": list(p.left_out),
    }


def machine_files(found: Identified, base: str, out: Path, origin: str) -> dict[Path, str]:
    """MACHINE.toml with the estimates, and its equipment with the zero points and scales that the drives determine.

    base: name or file of the sheet's machine. All values of the machine are written, since they are one joint estimate; the comment says how well
    each is known.
    """
    file = Path(base) if base.endswith(".toml") else MACHINES / f"{base}.toml"
    own = [e for e in found.estimates if e.quantity.kind == "machine" and e.quantity.parameter != PAYLOAD]
    comments = {e.quantity.parameter: _named(e) if len(e.quantity.keys) > 1 else summary(e) for e in own}
    lines = machine_lines([e.quantity for e in own], found.values, comments)
    head = f"# Identified: {origin}\n"
    text = head + with_values(file.read_text(encoding="utf-8"), _possible(found, lines))
    beside = companion(file, EQUIPMENT)
    equipment = (beside or FOLDER / f"{found.machine.family}.toml").read_text(encoding="utf-8")
    return {out: text, named(out, EQUIPMENT): head + with_values(equipment, list(_sensor_lines(found)))}


def _possible(found: Identified, lines: list[Line]) -> list[Line]:
    """The lines, with a yaw inertia moved to where the sum of two is no longer below the third.

    The fit frees each inertia by itself, and the correction for noise of the inputs does not know that a body must be rigid.
    """
    values = {(line.table, line.key): line.value for line in lines}
    changed = []
    for line in lines:
        if line.key == "izz_kg_m2" and line.table[0] in ("rear_frame", "front_frame"):
            ixx, iyy = values[line.table, "ixx_kg_m2"], values[line.table, "iyy_kg_m2"]
            value = min(max(line.value, abs(ixx - iyy)), ixx + iyy)
            comment = line.comment if value == line.value else f"{line.comment}; at the limit of a rigid body"
            line = Line(line.table, line.key, value, comment)
        changed.append(line)
    return changed


def _sensor_lines(found: Identified) -> Iterator[Line]:
    """Zero points and scales that the drives determine; the others keep the sheet's."""
    sheet = load_equipment(found.machine.family).sensors
    for e in found.estimates:
        name, value = e.quantity.parameter, found.values[e.quantity.parameter]
        if e.quantity.kind != "sensor" or e.status != "determined":
            continue
        channel, key, number = sensor_entry(name, value, sheet)
        yield Line(("sensors", channel), key, number, _named(e))
