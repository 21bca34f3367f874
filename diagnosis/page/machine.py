"""Draws the mismatch on the loader: side and top view, each place coloured by its residuals, findings numbered where they act.

Drawn to scale in metres from the machine sheet: x forward of the articulation joint, up or to the left.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from diagnosis.page.heat import level
from diagnosis.page.tables import Cell, heat, plain, table
from discrepancy.decision.evidence import Evidence
from discrepancy.signals.findings import Finding, Findings

MODELS = ("loader", "straight", "printed-estimator")
"""Models whose channels are measured on this machine."""

SCALE = 100.0  # units of the drawing in a metre
WHEELS = {
    "front_left": (1.5, 0.965),
    "front_right": (1.5, -0.965),
    "rear_left": (-1.5, 0.965),
    "rear_right": (-1.5, -0.965),
}
RADIUS, WIDTH = 0.74, 0.52
PIN = (2.84, 0.52)  # of the bucket, in the carry position

Point = tuple[float, float]


def _polygon(*points: Point) -> str:
    return f'<polygon points="{" ".join(f"{SCALE * x:.0f},{-SCALE * y:.0f}" for x, y in points)}"/>'


def _box(x: float, y: float, to_x: float, to_y: float) -> str:
    return _polygon((x, y), (to_x, y), (to_x, to_y), (x, to_y))


def _disc(x: float, y: float, radius: float) -> str:
    return f'<circle cx="{SCALE * x:.0f}" cy="{-SCALE * y:.0f}" r="{SCALE * radius:.0f}"/>'


def _bar(a: Point, b: Point, width: float) -> str:
    """A bar from a to b."""
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    nx, ny = -(b[1] - a[1]) / length * width / 2.0, (b[0] - a[0]) / length * width / 2.0
    return _polygon(
        (a[0] + nx, a[1] + ny), (b[0] + nx, b[1] + ny), (b[0] - nx, b[1] - ny), (a[0] - nx, a[1] - ny)
    )


@dataclass(frozen=True, slots=True)
class Part:
    """A place of the machine. A missing effect belongs to a place if its name matches `effects`: user-defined effects have no other tie."""

    title: str
    channels: str  # regular expression of the channels measured there; "" for none
    effects: str  # regular expression of the names of effects that act there
    side: str  # markup in the side view, "" where it is not visible
    top: str  # markup in the top view
    mark: tuple[Point, Point]  # place of a finding's number in the side view and in the top view [m]


def _wheel(name: str) -> Part:
    (x, y), title = WHEELS[name], name.replace("_", " ")
    near = y < 0.0  # seen from the right
    return Part(
        title=f"wheel {title}",
        channels=rf".*_{name}|speed|encoder",
        effects=r"tyre|wheel|rolling|cornering|slip|relax|camber|inflation|washboard|lug|soil|sink|kerb|ditch|brake|drive|motor|damping|deflection|"
        r"torque (error|scale)|reverse drag|transducer|(?<!steering )(?<!pivot )friction",
        side=_disc(x, 0.70, RADIUS) if near else "",
        top=_box(x - RADIUS, y - WIDTH / 2.0, x + RADIUS, y + WIDTH / 2.0),
        mark=((x, 0.70), (x, y)),
    )


PARTS: Mapping[str, Part] = {
    "rear frame": Part(
        "rear frame with engine and cab", "", r"mass split|(?<!spin )(?<!arm )inertia|frame torsion|aerodynamic|quadratic drag|centre of gravity",
        _polygon((-2.55, 0.75), (-2.55, 1.75), (-1.05, 1.85), (-0.12, 1.2), (-0.12, 0.75)) + _polygon((-1.15, 1.8), (-1.05, 3.05), (-0.05, 3.05), (0.12, 1.35)),
        _box(-2.55, -0.6, -0.12, 0.6), ((-2.1, 1.3), (-2.1, 0.0)),
    ),
    "front frame": Part("front frame", "", r"", _polygon((0.12, 0.75), (0.12, 1.25), (0.75, 2.1), (1.05, 2.05), (1.75, 1.0), (1.75, 0.75)), _box(0.12, -0.48, 1.75, 0.48), ((0.75, 1.2), (0.9, 0.0))),
    "rear axle": Part("rear axle and its pivot", "oscillation_angle", r"oscillation|axle", "", _bar((-1.5, -0.7), (-1.5, 0.7), 0.2), ((-1.5, 0.70), (-1.5, 0.35))),
    **{name: _wheel(name) for name in WHEELS},
    "joint": Part("articulation joint and steering", "joint_torque|yaw_rate_joint|articulation.*|steering_pressure_.*", r"steer|pivot|joint|articulation|play|halves|rotation|turning", _bar((0.0, 0.6), (0.0, 1.35), 0.2), _disc(0.0, 0.0, 0.2), ((0.0, 1.0), (0.0, 0.0))),
    "lift arm": Part("lift arm", "", r"lift arm|arm inertia", _bar((0.9, 1.98), PIN, 0.24), _bar((0.9, 0.62), (2.85, 0.62), 0.14) + _bar((0.9, -0.62), (2.85, -0.62), 0.14), ((2.3, 0.95), (2.3, 0.62))),
    "lift cylinder": Part("lift cylinders", "lift_pressure", r"pressure error", _bar((1.05, 1.5), (2.02, 1.14), 0.15), "", ((1.45, 1.35), (1.45, 0.62))),
    "tilt cylinder": Part("tilt cylinder", "tilt_pressure", r"tilt", _bar((0.95, 2.25), (2.72, 1.12), 0.13), _bar((0.95, 0.0), (2.75, 0.0), 0.14), ((1.9, 1.65), (1.9, 0.0))),
    "bucket": Part("bucket and payload", "", r"payload|pile|bucket|slosh", _polygon(PIN, (2.72, 1.2), (3.5, 1.25), (3.95, 0.75), (3.2, 0.3)), _box(2.9, -1.25, 3.85, 1.25), ((3.25, 0.8), (3.35, 0.0))),
    "inertial sensor": Part("inertial sensor and inclinometer", r"specific_force.*|acceleration.*|(roll|pitch|yaw)_(rate|angle)|lateral_acceleration", r"imu|gyro bias|accelerometer|lateral acceleration|slope sensor", _box(-0.66, 1.28, -0.34, 1.56), _box(-0.66, -0.16, -0.34, 0.16), ((-0.78, 1.62), (-0.85, 0.0))),
    "ground": Part("ground", "", r"grade|slope(?! sensor)|bank|surface|ground", _box(-2.9, -0.12, 4.1, -0.04), "", ((-2.7, -0.08), (-2.7, 0.0))),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Seen:
    """Residuals of the channels at a part, by channel [one-step errors]."""

    before: Mapping[str, float]  # of the baseline
    after: Mapping[str, float]  # with the effects found


def chapter(result: Findings, shown: Evidence) -> str:
    """The drawing before and after with a table of the same, or "" for a model of another machine."""
    if result.model not in MODELS:
        return ""
    seen = {key: _seen(part, shown) for key, part in PARTS.items()}
    marked = {key: [n for n, f in enumerate(result.findings, 1) if key in places(f)] for key in PARTS}
    several = any(s.after for s in seen.values())
    views = [_views("baseline", seen, marked, result, after=False)]
    views += [_views("with the effects found", seen, marked, result, after=True)] if several else []
    numbers = " Numbers show where the findings act." if any(marked.values()) else ""
    note = f"Largest residual of the channels measured at each place, in one-step errors.{numbers} Point at a place to see its channels."
    return f'<p class="soft">{note}</p><div class="machines">{"".join(views)}</div>{_table(seen, marked, several)}'


def places(f: Finding) -> list[str]:
    """Keys of the parts at which a finding acts: a sensor fault where it measures, an effect by its name, else by its place."""
    if f.kind == "sensor":
        channel = f.parameters[0].name.rpartition(".")[0] if f.parameters else ""
        return [key for key, part in PARTS.items() if part.channels and re.fullmatch(part.channels, channel)]
    for text in (f.effect.replace("_", " "), f.place):
        found = [key for key, part in PARTS.items() if part.effects and re.search(part.effects, text)]
        if found:
            return found
    return []


def _seen(part: Part, shown: Evidence) -> Seen:
    before, after = dict[str, list[float]](), dict[str, list[float]]()
    for row in shown.time_map:
        if not part.channels or not re.fullmatch(part.channels, row.channel):
            continue
        before.setdefault(row.channel, []).append(_size(row.before))
        if row.after is not None:
            after.setdefault(row.channel, []).append(_size(row.after))
    return Seen({c: max(v) for c, v in before.items()}, {c: max(v) for c, v in after.items()})


def _size(values: np.ndarray) -> float:
    """Root mean square over the intervals that were judged."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _views(
    title: str,
    seen: Mapping[str, Seen],
    marked: Mapping[str, Sequence[int]],
    result: Findings,
    *,
    after: bool,
) -> str:
    def drawn(side: bool) -> Iterator[str]:
        for key, part in PARTS.items():
            shape = part.side if side else part.top
            if shape:
                shown = seen[key].after if after else seen[key].before
                kind = f"h{level(max(shown.values()))}" if shown else "blank"
                yield f'<g class="part {kind}"><title>{escape(_tooltip(part, shown, marked[key], result))}</title>{shape}</g>'
        numbers: dict[Point, list[int]] = {}
        for key, part in PARTS.items():
            if marked[key] and (part.side if side else part.top):
                numbers[part.mark[0 if side else 1]] = list(marked[key])
        for at, which in numbers.items():
            yield from (_number(at, n, i) for i, n in enumerate(which))

    label = f"Mismatch on the machine, {title}"
    side = f'<svg viewBox="-300 -325 720 345" role="img" aria-label="{escape(label)}, from the right">{"".join(drawn(True))}</svg>'
    top = f'<svg viewBox="-300 -140 720 280" role="img" aria-label="{escape(label)}, from above">{"".join(drawn(False))}</svg>'
    return f'<figure class="machine"><figcaption>{escape(title)}</figcaption>{side}{top}</figure>'


def _number(at: Point, number: int, place: int) -> str:
    x, y = SCALE * at[0] + 26.0 * place, -SCALE * at[1]
    return f'<g class="mark"><circle cx="{x:.0f}" cy="{y:.0f}" r="14"/><text x="{x:.0f}" y="{y:.0f}">{number}</text></g>'


def _tooltip(part: Part, seen: Mapping[str, float], marked: Sequence[int], result: Findings) -> str:
    """The text of a tooltip."""
    channels = [f"{c.replace('_', ' ')}: {v:.1f} one-step errors" for c, v in seen.items()]
    found = [f"{n}. {result.findings[n - 1].effect}: {result.findings[n - 1].sentence}" for n in marked]
    return "\n".join(
        [part.title.capitalize(), *(channels or ["no recorded channel is measured here"]), *found]
    )


def _table(seen: Mapping[str, Seen], marked: Mapping[str, Sequence[int]], several: bool) -> str:
    """The same values as a table, for readers who cannot see or point at the drawing."""
    rows: list[list[Cell]] = []
    found = any(marked.values())
    for key, part in PARTS.items():
        if not seen[key].before and not marked[key]:
            continue
        worst = max(seen[key].before, key=lambda c: seen[key].before[c], default="")
        cells = [plain(part.title), plain(worst.replace("_", " ")), heat(seen[key].before.get(worst))]
        if several:
            left = seen[key].after
            cells.append(heat(max(left.values()) if left else None))
        rows.append([*cells, *([plain(", ".join(map(str, marked[key])))] if found else [])])
    sizes = ["before", "after, of any channel"] if several else ["mismatch"]
    head = ["place", "worst channel", *sizes, *(["findings"] if found else [])]
    return table(head, rows, numbers=range(2, 2 + len(sizes)))
