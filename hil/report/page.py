"""The report's page: one self-contained HTML file, no script or style from elsewhere."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike

from hil.render.scene import Picture
from hil.report import content
from hil.report.plot import LEFT, RIGHT, WIDTH, number, svg
from hil.rundir import RunDirectory
from hil.timing import Timing, judge_timing
from hil.verdict import RunVerdict, Verdict

HISTOGRAM_BINS = 40


@dataclass(frozen=True, slots=True)
class Section:
    """One run with everything the page says of it."""

    name: str
    run: RunDirectory
    verdict: RunVerdict | None
    timing: Timing | None
    pictures: Sequence[Picture]


def page(title: str, summary: str, verdicts: Sequence[Verdict], sections: Sequence[Section]) -> str:
    """The whole document."""
    style, script = (
        files("hil.report").joinpath(name).read_text(encoding="utf-8") for name in ("style.css", "cursor.js")
    )
    until = max((float(s.run.truth["time_s"][-1]) for s in sections if "time_s" in s.run.truth), default=1.0)
    body = [
        f'<header><h1>{escape(title)}</h1><p class="lead">{escape(summary)}</p>{_verdicts(verdicts)}</header><main>',
        _problems(sections),
        _side_by_side(
            "What happened", [(s, _figures(content.key_figures(s.run, s.verdict))) for s in sections]
        ),
        _side_by_side(
            "The machine", [(s, "".join(_picture(p) for p in s.pictures)) for s in sections if s.pictures]
        ),
        _side_by_side("States and warnings over time", [(s, _bands(s.run, until)) for s in sections]),
        _legend_of_severity(),
        _side_by_side(
            "Signals over time", [(s, _plots(s, i, until)) for i, s in enumerate(sections)], hint=_HINT
        ),
        _side_by_side(
            "Estimated against true normal force, up to lift-off", [(s, _errors(s.run)) for s in sections]
        ),
        _side_by_side("Loop timing", [(s, _timing(s)) for s in sections]),
        _side_by_side("Traffic on the bus", [(s, _traffic(s.run)) for s in sections], folded=True),
        _side_by_side("What was run", [(s, _figures(content.conditions(s.run))) for s in sections]),
        "</main><footer>Written by loaderhil. True values are the plant's own; the ECU sees the sensor frames only.</footer>",
    ]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>{''.join(body)}"
        f"<script>{script}</script></body></html>\n"
    )


_HINT = "Point at a plot, or focus it and use the arrow keys, to read every curve at that time."


def _verdicts(verdicts: Sequence[Verdict]) -> str:
    rows = "".join(
        f'<li class="{v.result.name.lower()}"><b>{v.result.value}</b><span>{escape(v.question)}: {escape(v.reason)}</span></li>'
        for v in verdicts
    )
    return f'<ul class="verdicts">{rows}</ul>' if rows else ""


def _problems(sections: Sequence[Section]) -> str:
    found = [f"{s.name}: {problem}" for s in sections for problem in s.run.problems]
    if not found:
        return ""
    return (
        f'<h2>What is missing</h2><ul class="problems">{"".join(f"<li>{escape(f)}</li>" for f in found)}</ul>'
    )


def _side_by_side(
    heading: str, parts: Sequence[tuple[Section, str]], *, hint: str = "", folded: bool = False
) -> str:
    shown = [(section, markup) for section, markup in parts if markup]
    if not shown:
        return ""
    columns = "".join(
        f'<section><p class="run">{escape(s.name)}</p>{markup}</section>' for s, markup in shown
    )
    inner = f'<p class="soft">{escape(hint)}</p>' if hint else ""
    inner += f'<div class="columns">{columns}</div>'
    if folded:
        return f"<h2>{escape(heading)}</h2><details><summary>Show the table</summary>{inner}</details>"
    return f"<h2>{escape(heading)}</h2>{inner}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], numeric_from: int = 1) -> str:
    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=n' if i >= numeric_from else ''}>{escape(value)}</{tag}>"
            for i, value in enumerate(values)
        )

    header = f"<thead><tr>{cells('th', head)}</tr></thead>" if head else ""
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f'<div class="table"><table>{header}<tbody>{body}</tbody></table></div>'


def _figures(figures: Sequence[content.Figure]) -> str:
    return _table((), [(f.name, f.value) for f in figures], numeric_from=9) if figures else ""


def _plots(section: Section, number_of_run: int, until_s: float) -> str:
    drawn = content.plots(section.run, section.verdict, until_s)
    return "".join(svg(plot, f"run{number_of_run}-plot{i}") for i, plot in enumerate(drawn))


def _picture(picture: Picture) -> str:
    data = b64encode(picture.png).decode("ascii")
    caption = escape(picture.caption)
    return (
        f'<figure class="picture"><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _bands(run: RunDirectory, until_s: float) -> str:
    return "".join(_band(band, until_s) for band in content.bands(run))


def _band(band: content.Band, until_s: float) -> str:
    """A state as a coloured bar; same horizontal scale as the plots below it."""
    scale = (WIDTH - LEFT - RIGHT) / max(until_s, 1e-3)
    parts, said = [], []
    for start, end, word, severity in band.stretches:
        label = word or "not set"
        parts.append(
            f'<rect class="s{severity}" x="{start * scale:.2f}" width="{max((end - start) * scale, 0.7):.2f}" height="20">'
            f"<title>{escape(label)}: {start:.2f} to {end:.2f} s</title></rect>"
        )
        if severity:
            said.append(f"{label} {start:.2f}-{end:.2f} s")
    text = escape("; ".join(said[:6]) or "quiet throughout")
    return (
        f'<div class="band"><span>{escape(band.name)}</span><svg role="img" aria-label="{escape(band.name)}: {text}" '
        f'viewBox="0 0 {WIDTH - LEFT - RIGHT} 20" preserveAspectRatio="none">{"".join(parts)}</svg></div>'
    )


def _legend_of_severity() -> str:
    words = (
        "stable, not set, not available",
        "attention, precaution, running",
        "warning, prevention, degraded, set",
        "imminent, lifted, safe values, fault",
    )
    spans = "".join(
        f'<span class="key"><i class="swatch" style="background:var(--s{i})"></i>{word}</span> '
        for i, word in enumerate(words)
    )
    return f'<p class="soft">{spans}</p>'


def _errors(run: RunDirectory) -> str:
    rows = [(wheel, f"{rms:.0f}", f"{100 * share:.1f}") for wheel, rms, share in content.load_errors(run)]
    return _table(("wheel", "RMS error [N]", "of standing load [%]"), rows) if rows else ""


def _timing(section: Section) -> str:
    if section.timing is None:
        return '<p class="soft">Lockstep runs have no timing: both sides are called in turn on a virtual clock.</p>'
    verdict = judge_timing(section.timing)
    text = _verdicts([verdict]) + _figures(content.timing_figures(section.timing))
    for name in section.run.timing:
        if name.endswith(("_lateness_ns", "_execution_ns")):
            text += _histogram(name, section.run.timing[name])
    note = '<p class="soft">Median / 99th percentile / largest.</p>'
    return text + note


def _histogram(name: str, values_ns: ArrayLike) -> str:
    """Counts over milliseconds, logarithmic in count so that single outliers show."""
    values = np.asarray(values_ns, float)
    values = values[np.isfinite(values)] * 1e-6
    if values.size == 0:
        return ""
    high = float(max(values.max(), 1e-3))
    counts, _ = np.histogram(values, HISTOGRAM_BINS, (0.0, high))
    level = np.log10(counts + 1) / np.log10(counts.max() + 1)
    width, height = 600, 70
    step = width / HISTOGRAM_BINS
    bars = "".join(
        f'<rect x="{i * step + 0.5:.1f}" y="{height - share * height:.1f}" width="{step - 1:.1f}" height="{share * height:.1f}"/>'
        for i, share in enumerate(level)
        if share > 0
    )
    process, what, _ = name.split("_")
    label = f"{what} of the {process}'s tick, {values.size} ticks, 0 to {number(high)} ms, counts on a logarithmic scale"
    return (
        f'<figure class="plot histogram"><figcaption>{escape(f"{what.capitalize()} of the {process}")} <small>ms, log count</small></figcaption>'
        f'<svg viewBox="0 0 {width} {height + 16}" role="img" aria-label="{escape(label)}">{bars}'
        f'<text x="0" y="{height + 13}">0</text><text x="{width}" y="{height + 13}" style="text-anchor:end">{number(high)} ms</text></svg></figure>'
    )


def _traffic(run: RunDirectory) -> str:
    rows = [
        (name, str(count), f"{mean:.2f}" if mean == mean else "–", f"{cycle:.0f}" if cycle else "–")
        for name, count, mean, cycle in content.traffic(run)
    ]
    return _table(("message", "frames", "mean period [ms]", "cycle time [ms]"), rows) if rows else ""


def plain_summary(sections: Sequence[Section]) -> str:
    """What happened, in a sentence per run."""
    sentences = []
    for section in sections:
        verdict = section.verdict
        if verdict is None:
            sentences.append(f"{section.name}: nothing could be judged.")
        elif verdict.rolled_over_s is not None:
            sentences.append(f"{section.name}: the machine rolled over; {_warning_words(verdict)}.")
        elif verdict.lift_off_s is not None:
            sentences.append(
                f"{section.name}: a wheel lifted but the machine stayed up; {_warning_words(verdict)}."
            )
        else:
            kept = f"every wheel kept at least {100 * verdict.margin:.0f} % of its standing load"
            sentences.append(f"{section.name}: no wheel lifted, {kept}.")
    return " ".join(sentences)


def _warning_words(verdict: RunVerdict) -> str:
    lead = verdict.lead_s
    if lead is None:
        return "no warning came"
    return f"the warning came {abs(lead):.2f} s {'before' if lead > 0 else 'after'} lift-off"
