"""The report's page: assembles all chapters into one self-contained HTML file."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from html import escape

from hil.faults.record import read_faults
from hil.timing.measured import judge_timing
from hil.verdict import WHEELS
from report.kit import bands, histogram, plot
from report.kit.axis import Axis
from report.kit.document import bar, document
from report.kit.plot import Timeline
from report.render import Film, Picture, Pictures, arrow_key
from report.run import deadlines, figures, signals
from report.run.figures import Figures
from report.run.parts import columns, table, verdict_list
from report.run.section import Headline, Section, headline, verdicts


def page(sections: Sequence[Section]) -> str:
    """The whole document."""
    title = _title(sections)
    lines = _timelines(sections)
    chapters = [
        ("missing", "What is missing", _problems(sections)),
        ("machine", "The machine", _machine(sections)),
        ("figures", "What happened", _figures(sections, lambda s: figures.what_happened(s.verdict))),
        ("faults", "Injected faults", _faults(sections)),
        ("states", "States and warnings", _states(sections, lines)),
        *((_slug(name), name, markup) for name, markup in _plots(sections, lines)),
        ("errors", "Estimation errors", _errors(sections)),
        ("timing", "Loop timing", _timing(sections)),
        ("deadlines", "Deadlines", deadlines.markup(sections)),
        ("traffic", "Traffic on the bus", _traffic(sections)),
        ("conditions", "What was run", _figures(sections, figures.conditions)),
        ("terms", "Terms", _TERMS),
    ]
    head = f"<h1>{escape(title)}</h1>{_subtitle(sections)}{_headlines(sections)}{verdict_list(verdicts(sections))}"
    return document(
        title=title,
        kicker="loaderhil bench report",
        head=head,
        chapters=chapters,
        footer="Written by loaderhil. True values are the plant's own; the ECU has the sensor frames only.",
        aside=_bar(sections),
        style=_sheets(sections),
    )


def _title(sections: Sequence[Section]) -> str:
    scenarios = dict.fromkeys(s.run.record.scenario.replace("_", " ") for s in sections)
    words = " and ".join(scenarios).capitalize()
    return f"{words}: {', '.join(s.name for s in sections)}" if len(sections) < 4 else words


def _subtitle(sections: Sequence[Section]) -> str:
    records = [s.run.record for s in sections]
    parts = [
        ", ".join(dict.fromkeys(values))
        for values in (
            [f"machine {r.machine}" for r in records],
            [f"payload {r.payload_kg:.0f} kg" for r in records],
            [f"{r.form} estimators" for r in records],
            ["in real time" if r.mode == "realtime" else "in lockstep" for r in records],
            [r.started[:10] for r in records],
        )
    ]
    return f'<p class="soft">{escape(" · ".join(parts))}</p>'


def _timelines(sections: Sequence[Section]) -> list[Timeline]:
    """One time axis for all runs, with each run's own marks and end."""
    axis = Axis(0.0, max([s.end_s for s in sections] + [0.1]))
    return [Timeline(axis, s.end_s or axis.end, signals.marks(s.verdict)) for s in sections]


def _headlines(sections: Sequence[Section]) -> str:
    cards = "".join(_card(s.name, headline(s, sections)) for s in sections)
    return f'<div class="cards">{cards}</div>'


def _card(name: str, outcome: Headline) -> str:
    return (
        f'<div class="card {outcome.kind}"><p class="run">{escape(name)}</p>'
        f'<p class="outcome">{escape(outcome.words)}</p><p>{escape(outcome.story)}</p></div>'
    )


def _problems(sections: Sequence[Section]) -> str:
    found = [(s.name, problem) for s in sections for problem in s.problems]
    rows = "".join(f"<li><b>{escape(name)}</b> {escape(problem)}</li>" for name, problem in found)
    return f'<ul class="problems">{rows}</ul>' if rows else ""


def _machine(sections: Sequence[Section]) -> str:
    shown = columns([(s.name, _drawn(s.pictures, i, s.name)) for i, s in enumerate(sections)])
    return f'<p class="soft">{arrow_key()}</p>{shown}' if shown else ""


def _drawn(pictures: Pictures, index: int, name: str) -> str:
    film = _film(pictures.film, index, name) if pictures.film else ""
    stills = "".join(_picture(picture) for picture in pictures.stills)
    views = _picture(pictures.views) if pictures.views else ""
    return f'{film}<div class="stills">{stills}</div>{views}' if pictures.stills else ""


def _picture(picture: Picture) -> str:
    data = b64encode(picture.data).decode("ascii")
    caption = escape(picture.caption)
    width, height = picture.size
    return (
        f'<figure class="picture"><img alt="{caption}" width="{width}" height="{height}" '
        f'src="data:{picture.kind};base64,{data}"><figcaption>{caption}</figcaption></figure>'
    )


def _sheets(sections: Sequence[Section]) -> str:
    """One style rule per film: its frames are used twice, in the chapter and in the bar, but stored once."""
    return "".join(
        f".film{i}{{background-image:url(data:image/webp;base64,{b64encode(film.sheet).decode('ascii')});"
        f"background-size:{100 * film.columns}% {100 * film.rows}%}}"
        for i, s in enumerate(sections)
        if (film := s.pictures.film)
    )


def _film(film: Film, index: int, name: str) -> str:
    """The frames, with controls that are hidden until the script runs."""
    start, end = film.times_s[0], film.times_s[-1]
    return (
        f'<figure class="film" data-film="{index}"><div class="stage film{index}" role="img" '
        f'aria-label="{escape(name)}: the machine at {film.times_s[film.start]:.2f} s" {_frames(film)}></div>'
        f'<div class="controls" hidden><button type="button" aria-label="Play {escape(name)}">&#9654;</button>'
        f'<input type="range" min="{start:.3f}" max="{end:.3f}" step="0.01" value="{film.times_s[film.start]:.3f}" '
        f'aria-label="Time [s] of the film, {escape(name)}"><output></output></div></figure>'
    )


def _frames(film: Film) -> str:
    return (
        f'data-columns="{film.columns}" data-rows="{film.rows}" data-start="{film.start}" '
        f'data-t="{film.times_s[0]:.6g} {film.times_s[-1]:.6g}" '
        f'style="background-position:{_frame_position(film, film.start)}"'
    )


def _frame_position(film: Film, frame: int) -> str:
    row, column = divmod(frame, film.columns)
    across = 100 * column / max(film.columns - 1, 1)
    down = 100 * row / max(film.rows - 1, 1)
    return f"{across:.4f}% {down:.4f}%"


def _bar(sections: Sequence[Section]) -> str:
    """The bar that stays visible: the time, the machine at that time, the zoom."""
    stages = "".join(
        f'<div class="stage film{i}" role="img" aria-label="{escape(s.name)}: the machine at the cursor" '
        f"{_frames(s.pictures.film)}></div>"
        for i, s in enumerate(sections)
        if s.pictures.film
    )
    return bar(stages)


def _states(sections: Sequence[Section], lines: Sequence[Timeline]) -> str:
    drawn = [
        (s.name, bands.markup(found, line) if (found := signals.state_bands(s.run)) else "")
        for s, line in zip(sections, lines, strict=True)
    ]
    raised = [(s.name, _raised(s)) for s in sections]
    return columns(drawn) + columns(raised)


def _faults(sections: Sequence[Section]) -> str:
    return columns([(s.name, _injected(s)) for s in sections])


def _injected(section: Section) -> str:
    rows = [
        (f.fault, f"{f.began_s:.2f}", "–" if f.ended_s is None else f"{f.ended_s:.2f}", str(f.struck))
        for f in read_faults(section.run.path)
    ]
    return table(("fault", "from [s]", "to [s]", "frames"), rows, numbers_from=1) if rows else ""


def _raised(section: Section) -> str:
    rows = [
        (name, meaning, f"{first:.2f}", f"{length:.2f}")
        for name, meaning, first, length in figures.warnings_raised(section.run)
    ]
    return table(("warning", "meaning", "first [s]", "for [s]"), rows, numbers_from=2) if rows else ""


def _plots(sections: Sequence[Section], lines: Sequence[Timeline]) -> Iterable[tuple[str, str]]:
    """A chapter per group; the same plot of all runs in one row, over one range."""
    per_run = [signals.groups(s.run, s.verdict) for s in sections]
    several = len(sections) > 1
    for same_group in zip(*per_run, strict=True):
        rows = []
        for same_plot in zip(*(group.plots for group in same_group), strict=True):
            # a plot without data in any run is left out; with data in one run the others show "not recorded", so that rows align
            if not any(p.drawn for p in same_plot):
                continue
            # one range for all runs, so that heights can be compared by eye
            upward = plot.common_range(same_plot)
            rows.append("".join(plot.markup(p, upward, t) for p, t in zip(same_plot, lines, strict=True)))
        if rows:
            heads = "".join(_key(s.name, t) for s, t in zip(sections, lines, strict=True))
            width = f' style="--runs:{len(sections)}"' if several else ""
            yield (
                same_group[0].title,
                f'<div class="rows {"several" if several else "single"}"{width}>{heads}{"".join(rows)}</div>',
            )


def _key(name: str, timeline: Timeline) -> str:
    """A run's name with its numbered moments."""
    moments = "".join(
        f'<span class="{mark.style}"><b>{i + 1}</b> {escape(mark.sentence)}</span>'
        for i, mark in enumerate(timeline.marks)
    )
    return f'<p class="run key">{escape(name)}{moments}</p>'


def _figures(sections: Sequence[Section], of: Callable[[Section], Figures] | Callable[..., Figures]) -> str:
    """A row per figure, a column per run."""
    rows = _rows([of(s.run) if of is figures.conditions else of(s) for s in sections])
    return table(("", *(s.name for s in sections)), rows) if rows else ""


def _errors(sections: Sequence[Section]) -> str:
    found = [{e.wheel: e for e in figures.load_errors(s.run)} for s in sections]
    if not any(found):
        return ""
    head = ["wheel"]
    for s in sections:
        head += [f"{s.name}: RMS [N]", "of standing load [%]", "mean [N]"]
    rows = []
    for wheel in WHEELS:
        row = [wheel]
        for errors in found:
            e = errors.get(wheel)
            row += (
                [f"{e.rms:.0f}", f"{100 * e.share:.1f}", f"{e.mean:+.0f}".replace("-", "−")]
                if e
                else ["–"] * 3
            )
        rows.append(row)
    note = "Normal force: estimate minus truth, where the ECU marks it valid, up to the first lift-off."
    return f'<p class="soft">{note}</p>{table(head, rows, numbers_from=1)}'


def _timing(sections: Sequence[Section]) -> str:
    timed = [s for s in sections if s.timing]
    if not timed:
        return '<p class="soft">A lockstep run has no timing: both sides are called in turn on a virtual clock.</p>'
    judged = columns([(s.name, verdict_list([judge_timing(s.timing)])) for s in timed if s.timing])
    loop = table(("", *(s.name for s in timed)), _rows([_timing_figures(s) for s in timed]))
    shown = [figures.histograms(s.run) for s in timed]
    rows = []
    for same in zip(*shown, strict=True):
        # one axis for all runs, as for the plots
        end = histogram.common_end(same)
        rows.append("".join(histogram.markup(h, end) for h in same))
    several = len(timed) > 1
    heads = "".join(f'<p class="run key">{escape(s.name)}</p>' for s in timed)
    width = f' style="--runs:{len(timed)}"' if several else ""
    return (
        f'{judged}{loop}<p class="soft">Times: median / 99th percentile / largest.</p>'
        f'<div class="rows {"several" if several else "single"}"{width}>{heads}{"".join(rows)}</div>'
    )


def _timing_figures(section: Section) -> Figures:
    timing = figures.timing_figures(section.timing) if section.timing else {}
    return timing | figures.memory_figures(section.run.record.vitals)


def _rows(per_run: Sequence[Figures]) -> list[tuple[str, ...]]:
    """A row per figure that any run has, a column per run."""
    names = dict.fromkeys(name for figure in per_run for name in figure)
    return [(name, *(figure.get(name, "–") for figure in per_run)) for name in names]


def _traffic(sections: Sequence[Section]) -> str:
    return columns([(s.name, _traffic_of(s)) for s in sections])


def _traffic_of(section: Section) -> str:
    found = figures.traffic(section.run)
    if not found:
        return ""
    rows = [
        (
            t.name,
            str(t.frames),
            f"{t.cycle_ms:.0f}" if t.cycle_ms else "–",
            f"{t.period_ms:.2f}" if t.frames > 1 else "–",
            "–" if t.lost is None else str(t.lost),
            f"{100 * t.load:.2f}" if t.frames > 1 else "–",
        )
        for t in found
    ]
    # a single frame has no period, and so no load
    total = sum(t.load for t in found if t.frames > 1)
    rows.append(
        (
            "all",
            str(sum(t.frames for t in found)),
            "",
            "",
            str(sum(t.lost or 0 for t in found)),
            f"{100 * total:.1f}",
        )
    )
    head = ("message", "frames", "cycle [ms]", "mean [ms]", "lost", "load [%]")
    text = table(head, rows, numbers_from=1, kind="table sum")
    if reported := figures.findings(section.run):
        text += "<h3>What the processes found in their inputs</h3>"
        text += table(("finding", "times"), list(reported.items()), numbers_from=1)
    if codes := figures.trouble_codes(section.run):
        text += "<h3>Trouble codes of the ECU</h3>"
        text += table(("suspect", "failure mode", "active from [s]", "times"), codes, numbers_from=2)
    return text


def _slug(name: str) -> str:
    return name.lower().replace(" ", "-")


_TERMS = (
    "<dl>"
    + "".join(
        f"<dt>{escape(term)}</dt><dd>{escape(meaning)}</dd>"
        for term, meaning in {
            "Lift-off": "A wheel's true normal force is zero for longer than 50 ms; the moment is the first sample of zero.",
            "Rolled over": "The true roll angle passes 45°, from where the machine does not come back.",
            "Warning": "The ECU's roll-over state is warning or above, or it sets Roll over predicted or Roll over now.",
            "Load-transfer ratio": "Right minus left over the sum of the four normal forces; 1 when the right wheels carry all.",
            "Lift-off margin": "The smallest normal force of a wheel over what it carried standing; 0 is lift-off.",
            "Gaps in a curve": "The ECU marked its estimate invalid, or predicted no lift-off within its horizon.",
            "Estimates below zero": "The pull that would hold the wheel on the ground.",
            "INCONCLUSIVE": "The question could not be judged, for the reason given. A starved machine never passes.",
            "Lateness, reaction": "Start of a tick after its due time; from a sample's frame to the first answer that echoes it.",
            "Load of the bus": "At 500 kbit/s, stuff bits not counted: they add up to 23 %.",
            "Lost": "Counts that the alive counter of a message skipped, as the recorder saw them.",
        }.items()
    )
    + "</dl>"
)
