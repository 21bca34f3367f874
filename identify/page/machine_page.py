"""The page of a machine that was identified from its drives."""

from collections.abc import Iterator
from html import escape

import numpy as np

from identify.ends import NORMAL_95
from identify.machine.drives import Estimated, Identified
from identify.machine.programme import Programme
from identify.machine.results import (
    Profiles,
    interval_text,
    programme_lines,
    together,
    undetermined,
    warnings,
)
from identify.page import forest
from identify.page.figure import STYLE, Line, drawn, table
from report.kit.document import bar, document


def machine_page(found: Identified, profiles: Profiles, programme: Programme | None, *, origin: str) -> str:
    """The whole page."""
    own = [e for e in found.estimates if e.quantity.kind == "machine"]
    sensors = [e for e in found.estimates if e.quantity.kind == "sensor"]
    adequate = not found.inadequate
    chapters = [
        (
            "machine",
            "Machine",
            forest.forest([_forest_row(found, e) for e in own]) + _parameters(own, profiles),
        ),
        ("sums", "The machine as a whole", _sums(found)),
        ("sensors", "Zero points and scales", _parameters(sensors, profiles)),
        ("open", "What the drives do not determine", _list([*undetermined(found), *together(found)])),
        ("programme", "Shortest drive programme", "" if programme is None else _programme(found, programme)),
        ("channels", "Does the model describe the drives?", _channels(found)),
        ("residuals", "Residuals", f'<div class="columns">{"".join(_residuals(found))}</div>'),
    ]
    problems = "".join(f"<li>{escape(text)}</li>" for text in warnings(found))
    verdict = (
        "The model describes every channel within its budget."
        if adequate
        else "The model does not describe these drives."
    )
    return document(
        title=f"Machine of {', '.join(found.recordings)}",
        kicker="Identification: machine",
        head=f"<h1>{escape(found.machine.name)}</h1><p>{escape(', '.join(found.recordings))}: {len(found.problem.windows)} segments, "
        f"{found.noise.keep.size} rows. {verdict}</p>" + (f'<ul class="problems">{problems}</ul>' if problems else ""),
        chapters=chapters,
        footer=origin,
        aside=bar(),
        style=STYLE + forest.STYLE,
    )  # fmt: skip


def _forest_row(found: Identified, e: Estimated) -> forest.Row:
    p = found.model.parameter(e.quantity.parameter)
    mean, prior_sd = found.priors[p.name]
    # the sheet's standard deviation is the unit, also where weighings have narrowed the prior
    unit = p.prior_sd or prior_sd
    at, half = found.values[p.name], NORMAL_95 * found.sd(p.name)

    def from_sheet(value: float) -> float:
        return (value - p.value) / unit

    return forest.Row(
        e.quantity.label,
        from_sheet(at),
        from_sheet(at - half),
        from_sheet(at + half),
        (from_sheet(mean - NORMAL_95 * prior_sd), from_sheet(mean + NORMAL_95 * prior_sd)),
        e.status != "not determined",
    )


def _parameters(shown: list[Estimated], profiles: Profiles) -> str:
    rows = []
    for e in shown:
        low, high = interval_text(e)
        row = [e.quantity.label, f"{e.value:.5g}", f"{low} to {high}", e.quantity.unit, f"{e.sheet:.5g}"]
        row += [f"{e.prior[0]:.4g} to {e.prior[1]:.4g}", f"{e.remaining:.2f}", e.status]
        p = profiles.get(e.quantity.parameter)
        if profiles:
            row.append(
                "" if p is None else f"{e.quantity.value(p.lower):.5g} to {e.quantity.value(p.upper):.5g}"
            )
        rows.append(row)
    head = ["parameter", "value", "95 % interval", "unit", "sheet", "prior, 95 %", "posterior/prior sd", "by these drives"]  # fmt: skip
    return table([*head, *(["by profile likelihood"] if profiles else [])], rows)


def _sums(found: Identified) -> str:
    rows = [
        (name, f"{v:.5g}", f"{v - NORMAL_95 * sd:.5g} to {v + NORMAL_95 * sd:.5g}", unit)
        for name, unit, v, sd in found.sums
    ]
    return table(("", "value", "95 % interval", "unit"), rows)


def _list(texts: list[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(t)}</li>' for t in texts)}</ul>" if texts else ""


def _programme(found: Identified, programme: Programme) -> str:
    names = list(programme.now)
    rows = [("now", "", *(f"{programme.now[n]:.2f}" for n in names))]
    rows += [(s.drive.name, f"{s.drive.duration_s:g} s", *(f"{s.remaining[n]:.2f}" for n in names)) for s in programme.steps]  # fmt: skip
    texts = [t for t in programme_lines(found, programme) if not t.startswith(" ")]
    return _list(texts) + (table(("drive", "duration", *names), rows) if programme.steps else "")


def _channels(found: Identified) -> str:
    rows = [
        (
            c.channel,
            f"{c.one_step:.3g}",
            f"{c.simulated:.3g}",
            f"{c.simulated_budget:.3g}",
            c.unit,
            "within" if c.adequate else "beyond",
        )
        for c in found.channels
    ]
    return table(("channel", "one-step error", "error of the simulation", "budget", "unit", ""), rows)


def _residuals(found: Identified) -> Iterator[str]:
    problem = found.problem
    left = problem.measured - problem.predict(found.fit.values)
    recording = np.array([w.recording for w in problem.windows])[problem.row_window]
    for name in found.recordings:
        for i, channel in enumerate(problem.channels):
            rows = np.flatnonzero((problem.row_channel == i) & (recording == name))
            if not rows.size:
                continue
            rows = rows[np.argsort(problem.row_time[rows], kind="stable")]
            time_s, values = problem.row_time[rows], left[rows].copy()
            # a line across what is not scored would show errors that nobody measured
            values[np.flatnonzero(np.diff(problem.row_window[rows])) + 1] = np.nan
            yield drawn(
                f"{channel}, {name}",
                "time [s]",
                problem.model.outputs[channel],
                [],
                [Line(name="measured minus predicted", across=time_s, upward=values)],
            )
