"""The page of a tyre that was identified from a field test."""

from dataclasses import fields
from html import escape
from itertools import pairwise

import numpy as np

from identify.ends import NORMAL_95
from identify.field.chain import ASPHALT_GROUPS, GRAVEL_GROUPS, FieldResult, Points, load_groups
from identify.field.fit import COMPLIANCE, HEADING, SHIFT, SMALL_ANGLE, PointProblem, slip_angle
from identify.page.figure import STYLE, Cloud, Line, drawn, table
from identify.tyre.advice import Open
from identify.tyre.brush import brush_force, fit_brush
from identify.tyre.combined import weight
from identify.tyre.curve import steady
from identify.tyre.estimate import Estimate
from identify.tyre.parameters import COMBINED, INDEX, MEANINGS, curve, vector
from report.kit.document import bar, document

SLIP_BANDS = (0.01, 0.05, 0.2, 3.0)
"""Edges of the slips that one drawing of combined slip takes together."""

OTHERS = {
    "gain": "scale of the transducer, both forces",
    "tare": "zero of the longitudinal force that is left [N]",
    SHIFT: "zero of the slip: an error of the effective radius",
    HEADING: "heading of the markers beside the wheel's plane [rad]",
    COMPLIANCE: "carcass compliance [m/N]: how far slip lags; without windows after changes of slip, its prior",
}


def field_page(
    result: FieldResult, problem: PointProblem, found: Estimate, *, opened: list[Open], origin: str
) -> str:
    """The whole page."""
    rows = [
        (
            n,
            MEANINGS.get(n, OTHERS.get(n, "")),
            f"{i.value:.5g}",
            f"{i.lower:.5g} to {i.upper:.5g}",
            found.by(n),
        )
        for n in found.names
        for i in [found.interval(n)]
    ]
    chapters = [
        (
            "result",
            "Parameters",
            table(("parameter", "meaning", "value", "95 % interval", "interval by"), rows),
        ),
        (
            "open",
            "What the data do not determine",
            table(("parameter", "why", "what would"), [(o.name, o.reason, o.step) for o in opened]),
        ),
        ("groups", "Load groups", _groups(result, problem, found)),
        *([("combined", "At a slip angle", _combined(problem, found))] if problem.combined else []),
        ("clock", "One clock", _clock(result)),
        ("events", "Events", _events(result)),
        (
            "rejected",
            "What was rejected",
            table(("reason", "samples"), [(r, str(n)) for r, n in sorted(result.rejected.items())]),
        ),
    ]
    warnings = "".join(f"<li>{escape(w)}</li>" for w in result.warnings)
    head = f"<h1>{escape(result.log.name)}</h1><p>{len(result.events)} events, {result.points.slip.size} points of settled slip</p>"
    head += f'<ul class="problems">{warnings}</ul>' if warnings else ""
    return document(
        title=f"Tyre of {result.log.name}",
        kicker="Identification: field",
        head=head,
        chapters=chapters,
        footer=origin,
        aside=bar(),
        style=STYLE,
    )


def _straight(points: Points) -> Points:
    """Those without a slip angle."""
    kept = np.abs(points.side_slip) <= SMALL_ANGLE
    return Points(**{f.name: getattr(points, f.name)[kept] for f in fields(points)})


def _combined(problem: PointProblem, found: Estimate) -> str:
    """The share of the force that remains at a slip angle, for bands of slip: the law at the middle slip, and points beside it as they are beside their own."""
    v, points = found.values, problem.points
    [part] = problem.parts(dict(v))
    tan_alpha = slip_angle(v, points.side_slip)
    coefficients = [v[n] for n in COMBINED]
    measured = points.force - v["tare"]
    ratio = measured / (part.residual * problem.scale + measured)
    covariance = found.covariance[np.ix_(*[[found.names.index(n) for n in COMBINED]] * 2)]
    span = np.linspace(0.0, float(np.max(np.abs(tan_alpha))), 200)
    parts = []
    for low, high in pairwise(SLIP_BANDS):
        own = (np.abs(points.slip) >= low) & (np.abs(points.slip) < high)
        if not own.any():
            continue
        slip = float(np.median(np.abs(points.slip[own])))
        middle, by = weight(np.full(span.size, slip), span, *coefficients)
        J = np.stack([by[n] for n in COMBINED], axis=1)
        half = NORMAL_95 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", J, covariance, J), 0.0))
        line = Line(name="law, 95 %", across=span, upward=middle, lower=middle - half, upper=middle + half)
        law, _ = weight(np.full(int(own.sum()), slip), tan_alpha[own], *coefficients)
        cloud = Cloud(name="points", across=np.abs(tan_alpha[own]), upward=law * ratio[own])
        parts.append(
            drawn(f"slips around {slip:.3g}", "tan(slip angle)", "share of the force", [cloud], [line])
        )
    return f'<div class="columns">{"".join(parts)}</div>'


def _groups(result: FieldResult, problem: PointProblem, found: Estimate) -> str:
    points = _straight(result.points) if problem.combined else result.points
    groups = load_groups(points, ASPHALT_GROUPS, result.log.wheel_weight)
    if sum(int(m.sum()) for _, m in groups) < points.load.size:
        groups = load_groups(points, GRAVEL_GROUPS, result.log.wheel_weight)
    p = vector({**problem.fixed, **{n: v for n, v in found.values.items() if n in INDEX}})
    parts = []
    for load, mask in groups:
        span = np.linspace(float(points.slip[mask].min()) - 0.01, float(points.slip[mask].max()) + 0.01, 300)
        c, by_p, _ = curve(p, problem.nominal, load, problem.nominal.pressure)
        force, by = np.empty(300), np.empty((300, 7))
        steady(np.tile(c, (300, 1)), span, force, by)
        J = np.zeros((300, len(found.names)))
        for i, name in enumerate(found.names):
            if name in INDEX:
                J[:, i] = by @ by_p[:, INDEX[name]]
        half = NORMAL_95 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", J, found.covariance, J), 0.0))
        lines = [
            Line(
                name="Magic Formula, 95 %",
                across=span,
                upward=force / 1e3,
                lower=(force - half) / 1e3,
                upper=(force + half) / 1e3,
            )
        ]
        if mask.sum() >= 6 and np.ptp(points.slip[mask]) > 0.05:
            brush = fit_brush(points.slip[mask], points.force[mask], points.load[mask])
            lines.append(
                Line(
                    name=f"brush, friction {brush.friction:.3f}",
                    across=span,
                    upward=brush_force(span, load, brush.friction, brush.slip_stiffness)[0] / 1e3,
                    style="predicted",
                )
            )
        clouds = [
            Cloud(name="slip by the encoder", across=points.slip[mask], upward=points.force[mask] / 1e3),
            Cloud(
                name="slip by the markers",
                across=points.slip_markers[mask],
                upward=points.force[mask] / 1e3,
                rejected=True,
            ),
        ]
        parts.append(drawn(f"{load / 1e3:.1f} kN on the road", "slip", "kN", clouds, lines))
    return f'<div class="columns">{"".join(parts)}</div>'


def _clock(result: FieldResult) -> str:
    s = result.sync
    pulse = "none" if s.by_pulse is None else f"{s.by_pulse:.4f} s"
    rows = [
        ("offset by content", f"{s.offset:.5f} s ± {NORMAL_95 * s.offset_sd:.5f}"),
        ("drift", f"{1e6 * s.drift:.1f} ± {1e6 * NORMAL_95 * s.drift_sd:.1f} per million"),
        ("pulse", pulse),
        ("strongest oscillation of the force", f"{result.oscillation_hz:.1f} Hz"),
    ]
    each = [
        (
            str(i + 1),
            f"{1e3 * o:.2f} ± {1e3 * NORMAL_95 * d:.2f} ms",
            "not synchronised" if i in s.lost else "",
        )
        for i, (o, d) in enumerate(zip(s.event_offset, s.event_sd, strict=True))
    ]
    return table(("", ""), rows) + table(("event", "beside the common clock", ""), each)


def _events(result: FieldResult) -> str:
    parts = []
    for e in result.events:
        lines = [
            Line(
                name="slip by the encoder [%]", across=e.time, upward=np.where(e.kept, 100.0 * e.slip, np.nan)
            ),
            Line(
                name="slip by the markers [%]",
                across=e.time,
                upward=np.where(e.kept, 100.0 * e.slip_markers, np.nan),
                style="predicted",
            ),
            Line(name="force [kN]", across=e.time, upward=e.force / 1e3, style="demand"),
        ]
        parts.append(drawn(f"event {e.number + 1}", "time [s]", "mixed", [], lines))
    return f'<div class="columns">{"".join(parts)}</div>'
