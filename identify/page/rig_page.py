"""The page of a tyre that was identified from the log of a rig."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from identify.ends import NORMAL_95
from identify.page.figure import STYLE, Cloud, Line, drawn, table
from identify.rig.chain import Prepared
from identify.rig.models import Compared, simulated, transient_slip
from identify.rig.relaxation import StepLength
from identify.rig.relaxation import table as step_rows
from identify.tyre.advice import Open
from identify.tyre.curve import steady
from identify.tyre.estimate import Estimate
from identify.tyre.parameters import INDEX, MEANINGS, NAMES, curve, vector
from identify.tyre.rig_problem import CARCASS_NAME, RigProblem
from identify.tyre.search import Search
from report.kit.document import bar, document

Array = NDArray[np.float64]

STEPS_HEAD = (
    "run",
    "mean slip",
    "load [kN]",
    "length [m], transient model",
    "by (99) as printed",
    "by (99) with the force before and the road's distance",
)


def rig_page(
    ready: Prepared,
    problem: RigProblem,
    found: Estimate,
    *,
    stages: Sequence[Estimate],
    steps: Sequence[StepLength],
    models: Sequence[Compared],
    search: Search | None,
    opened: Sequence[Open],
    origin: str,
) -> str:
    """The whole page."""
    chapters = [
        ("result", "Parameters", _parameters(found)),
        (
            "open",
            "What the data do not determine",
            table(("parameter", "why", "what would"), [(o.name, o.reason, o.step) for o in opened]),
        ),
        ("curves", "Fits per load and pressure", _curves(ready, found)),
        ("residuals", "Residuals", _residuals(problem, found)),
        ("relaxation", "Relaxation length", _relaxation(steps)),
        ("validation", "Response to steps of slip", _validation(ready, problem, found)),
        (
            "models",
            "Models on runs they were not fitted to",
            table(
                ("model", "error [N]", "of the force"),
                [(m.model, f"{m.rms:.0f}", f"{m.share:.1%}") for m in models],
            ),
        ),
        ("staged", "Staged fit beside the joint one", _staged(stages, found)),
        ("search", "Trust region and differential evolution", _search(search)),
        ("raw", "Raw data and what was rejected", _raw(ready)),
    ]
    agreed = (
        ""
        if search is None or search.agree
        else '<p class="problems">The two optimisers disagree: the parameters below are doubtful.</p>'
    )
    warnings = "".join(f"<li>{escape(w)}</li>" for w in [*ready.unusable, *ready.warnings])
    head = f"<h1>{escape(ready.log.name)}</h1><p>{len(ready.traces)} runs, {found.rows} averaged samples fitted, noise of order {found.noise_order}</p>{agreed}"
    head += f'<ul class="problems">{warnings}</ul>' if warnings else ""
    return document(
        title=f"Tyre of {ready.log.name}",
        kicker="Identification: rig",
        head=head,
        chapters=chapters,
        footer=origin,
        aside=bar(),
        style=STYLE,
    )


def _parameters(found: Estimate) -> str:
    random = np.random.default_rng(0)
    rows = []
    for name in found.names:
        if name not in INDEX and name != CARCASS_NAME and not name.startswith("gain"):
            continue
        i = found.interval(name)
        boot = NORMAL_95 * found.bootstrap_sd(name, random)
        rows.append(
            (
                name,
                MEANINGS.get(name, ""),
                f"{i.value:.5g}",
                f"{i.lower:.5g} to {i.upper:.5g}",
                found.by(name),
                f"{boot:.2g}",
            )
        )
    note = '<p class="soft">The interval holds all that is unknown, load and gain included. The bootstrap resamples seconds of the runs, and so holds their noise alone. Where parameters can change together without any first-order effect on the data, the curvature of the likelihood says nothing of them, and the interval is where the likelihood itself falls.</p>'
    return note + table(
        ("parameter", "meaning", "value", "95 % interval", "interval by", "± by bootstrap"), rows
    )


def _staged(stages: Sequence[Estimate], found: Estimate) -> str:
    """Value of each parameter by stage and in the joint fit, and how far the last stage lies from it."""
    rows = []
    for name in (n for n in found.names if n in INDEX or n == CARCASS_NAME):
        i = found.interval(name)
        by_stage = [f"{s.values[name]:.5g}" if name in s.names else "" for s in stages]
        away = (stages[-1].values[name] - i.value) / i.sd if name in stages[-1].names and i.sd > 0.0 else 0.0
        rows.append((name, *by_stage, f"{i.value:.5g}", f"{away:+.1f}"))
    note = (
        '<p class="soft">As in the thesis: nominal runs, all loads, all pressures, each stage from the one before, simulated, under white noise. '
        "The last column is the distance of the last stage from the joint fit, in standard deviations of the joint fit.</p>"
    )
    heads = [f"stage {k}: {s.rows} samples" for k, s in enumerate(stages, 1)]
    return note + table(("parameter", *heads, "joint", "last stage away by"), rows)


def band(found: Estimate, ready: Prepared, load: float, pressure: float, kappa: Array) -> tuple[Array, Array]:
    """Force (n,) and half of its 95 % interval (n,) at a load and a pressure, load included."""
    p = vector({n: v for n, v in found.values.items() if n in INDEX})
    c, by_p, _ = curve(p, ready.log.nominal, load, pressure)
    force, by = np.empty(kappa.size), np.empty((kappa.size, 7))
    steady(np.tile(c, (kappa.size, 1)), kappa, force, by)
    J = np.zeros((kappa.size, len(found.names)))
    for i, name in enumerate(found.names):
        if name in INDEX:
            J[:, i] = by @ by_p[:, INDEX[name]]
    return force, NORMAL_95 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", J, found.covariance, J), 0.0))


def _curves(ready: Prepared, found: Estimate) -> str:
    groups: dict[tuple[float, float], list[int]] = {}
    for i, t in enumerate(ready.traces):
        if t.kind in ("drive", "brake"):
            groups.setdefault((t.piston_pressure, t.inflation), []).append(i)
    parts = []
    for (piston, inflation), members in groups.items():
        load = float(
            ready.loads.row(piston)
            @ (
                ready.loads.line
                + ready.loads.root
                @ np.array([found.values.get("load 0", 0.0), found.values.get("load 1", 0.0)])
            )
        )
        kappa, force, rejected = [], [], []
        for i in members:
            t = ready.traces[i]
            tare = found.values.get(f"tare {t.name}", 0.0)
            kappa.append(transient_slip(t, 0.3))
            force.append((t.force - tare) / found.values.get("gain", 1.0))
            rejected.append(~t.kept)
        k, f, bad = np.concatenate(kappa), np.concatenate(force), np.concatenate(rejected)
        span = np.linspace(float(np.min(k)), float(np.max(k)), 300)
        curve_, half = band(found, ready, load, inflation, span)
        parts.append(drawn(
            f"{load / 1e3:.1f} kN, {inflation / 1e5:g} bar", "slip behind a relaxation of 0.3 m", "kN",
            [Cloud(name="measured", across=k[~bad], upward=f[~bad] / 1e3)],
            [Line(name="Magic Formula, 95 %", across=span, upward=curve_ / 1e3, lower=(curve_ - half) / 1e3, upper=(curve_ + half) / 1e3)],
        ))  # fmt: skip
    return f'<div class="columns">{"".join(parts)}</div>'


def _residuals(problem: RigProblem, found: Estimate) -> str:
    parts = []
    for trace, part in zip(problem.traces, problem.parts(dict(found.values)), strict=True):
        values = np.where(part.kept, -part.residual, np.nan)
        parts.append(
            drawn(
                trace.name,
                "time [s]",
                "N",
                [],
                [Line(name="measured minus predicted", across=trace.time, upward=values)],
            )
        )
    return f'<div class="columns">{"".join(parts)}</div>'


def _relaxation(steps: Sequence[StepLength]) -> str:
    if not steps:
        return ""
    loads = sorted({round(s.load) for s in steps})
    clouds = [Cloud(name=f"{load / 1e3:.1f} kN", across=np.array([s.slip for s in steps if round(s.load) == load]), upward=np.array([s.length for s in steps if round(s.load) == load]), rejected=i > 0) for i, load in enumerate(loads)]  # fmt: skip
    return drawn("Relaxation length", "mean slip of the step", "m", clouds) + table(
        STEPS_HEAD, step_rows(steps)
    )


def _validation(ready: Prepared, problem: RigProblem, found: Estimate) -> str:
    parts = []
    for trace in ready.validation:
        model = simulated(problem, trace, dict(found.values))
        measured = np.where(trace.kept, trace.force, np.nan)
        rms = float(np.sqrt(np.nanmean((model - measured) ** 2)))
        lines = [
            Line(name="measured", across=trace.time, upward=measured / 1e3, style="truth"),
            Line(name="simulated from the slip alone", across=trace.time, upward=model / 1e3),
        ]
        parts.append(drawn(f"{trace.name}: error {rms:.0f} N", "time [s]", "kN", [], lines))
        parts.append(
            drawn("Slip", "time [s]", "1", [], [Line(name="measured", across=trace.time, upward=trace.slip)])
        )
    return f'<div class="columns">{"".join(parts)}</div>' if parts else ""


def _search(search: Search | None) -> str:
    if search is None:
        return '<p class="soft">Not run.</p>'
    rows = [
        (n, f"{a:.6g}", f"{b:.6g}")
        for n, a, b in zip(search.names, search.trust_region.tolist(), search.evolution.tolist(), strict=True)
    ]
    rows.append(("cost", f"{search.costs[0]:.6g}", f"{search.costs[1]:.6g}"))
    rows.append(("evaluations", str(search.evaluations[0]), str(search.evaluations[1])))
    verdict = "Both find the same tyre." if search.agree else "They disagree."
    return f"<p>{verdict} Nominal load and pressure; population 100, at most 100 generations.</p>" + table(
        ("parameter", "trust region", "evolution"), rows
    )


def _raw(ready: Prepared) -> str:
    counts: Mapping[str, int] = ready.rejected
    parts = []
    for t in ready.traces:
        lines = [
            Line(name="cylinder [m/s]", across=t.time, upward=t.speed, style="demand"),
            Line(name="wheel [m/s]", across=t.time, upward=t.wheel),
            Line(name="force [10 kN]", across=t.time, upward=np.nan_to_num(t.force) / 1e4, style="predicted"),
        ]
        lost = Cloud(
            name="rejected", across=t.time[~t.kept], upward=np.zeros(int((~t.kept).sum())), rejected=True
        )
        parts.append(
            drawn(
                f"{t.name}, scale factor {t.scale:.5g} m ± {2.0 * t.scale_sd:.1e}",
                "time [s]",
                "mixed",
                [lost],
                lines,
            )
        )
    return (
        table(("reason", "samples"), [(r, str(n)) for r, n in sorted(counts.items())])
        + f'<div class="columns">{"".join(parts)}</div>'
    )


__all__ = ["NAMES", "rig_page"]
