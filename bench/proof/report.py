"""Writes the report of the proof as a page of Markdown, docs/results/proof.md."""

import platform
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from bench.proof import real, score
from bench.proof.arm import LOADERS, Done

HEAD = ("| metric | target | measured | met |", "|---|---|---|---|")
BODIES = {
    "straight": "A loader driving straight, truth by Runge-Kutta in closed loop, 12 effects of which 4 of sensors, 96 s at 25 Hz",
    "ball": "A ball thrown three times, truth by an adaptive method of order 8, 6 effects, 60 pictures a second",
    "car": "A small car, truth at 1 kHz, 14 effects of which 9 of sensors, 60 s",
    "loader": "The wheel loader through sensors, CAN encoding and ECU, its whole library; truth by Runge-Kutta at 1 ms",
    "mujoco": "The wheel loader, moved by MuJoCo instead of our plant",
}
REMARKS = (
    "- lambda is measured on the recording that holds the effect, by an oracle that knows it: what the outputs change by it beyond all refitted",
    "  nuisances, squared, over the noise, and how much those strain their priors for it; the correlation of the scores counted. Where that is not within 0.8 to 1.5 of the lambda wanted (a bound of the parameter, say), the arm counts in no row.",
    "- The loader's effects have 0.3, 1 and 3 times their typical size; lambda is what that comes to. Where baseline parameters can do the same within what is known of them it is",
    "  near 0, whatever the size. Such arms count in the rows by lambda only, but those that were missed are among the failures.",
    "- Shares have Wilson's 95 % interval; the upper bound on nulls is Clopper and Pearson's, one-sided.",
    "- pysindy (STLSQ on smoothed derivatives) is given the exact terms of the library, mass and drag to project out, and that threshold of its grid",
    "  at which it does best, run by run; its answer is the largest term.",
    "- Tied: the hidden effect is in the group of the first finding, its likelihood within 1 of it. A lag and a delay of a millisecond, a bias and a scale at one speed are the same",
    "  to first order: no method can distinguish them, and one of them comes first by chance.",
    "- A channel is right if the oracle gives it at least 80 % of the largest share of lambda.",
)


def publish(text: str, out: Path | None) -> None:
    """A page into a file, else onto the terminal."""
    if out is None:
        print(text)
    else:
        out.write_text(text, encoding="utf-8")


def commit() -> str:
    """The last commit that touched more than documents, marked where files differ from it."""
    rest = ("--", ".", ":!docs")
    head = subprocess.run(
        ["git", "log", "-1", "--format=%h", *rest], capture_output=True, text=True, check=False
    )
    changed = subprocess.run(["git", "diff", "--quiet", "HEAD", *rest], check=False)
    return (head.stdout.strip() or "unknown") + ("-dirty" if changed.returncode else "")


def report(
    done: Sequence[Done], broken: Mapping[str, str], planned: int, command: str, about: Mapping[str, str]
) -> str:
    """The whole page. broken: arms that did not finish, with the reason; planned: number of arms; about: commit and note of the run."""
    lines = [
        f"# Proof of the discrepancy engine{_of_what({d.arm.body for d in done})}",
        "",
        f"`{command}`, commit {about['commit']}, Python {platform.python_version()}, numpy {np.__version__}; {len(done)} of {planned} arms,"
        f" {sum(d.seconds for d in done) / 3600.0:.1f} h of diagnosis. {about['note']}",
        "",
        "Every arm is seeded; the same command gives the same figures. What the words mean: [explanation](../explanation/discrepancy.md).",
        "",
    ]
    for body, title in BODIES.items():
        mine = [d for d in done if d.arm.body == body]
        if mine:
            lines += [f"## {title}", "", *_body(mine), ""]
    lines += _real([d for d in done if d.arm.kind == "real"])
    lines += ["## How to read it", "", *REMARKS, "", "## Failures, all of them", ""]
    missed = list(score.failures(done))
    lines += ["| arm | lambda | hidden | reported |", "|---|---|---|---|", *missed] if missed else ["None."]
    if broken:
        lines += ["", "Not finished:", "", *(f"- {key}: {why}" for key, why in broken.items())]
    return "\n".join(lines) + "\n"


def _of_what(bodies: set[str]) -> str:
    """What a page of some bodies is of, after its title."""
    if not bodies:
        return ""
    if bodies <= {"real", "thesis"}:
        return ": real recordings and the thesis' estimators"
    return ": the whole loader" if bodies <= set(LOADERS) else ""


def _body(done: Sequence[Done]) -> Iterator[str]:
    kinds = {kind: sum(d.arm.kind == kind for d in done) for kind in dict.fromkeys(d.arm.kind for d in done)}
    yield f"{len(done)} arms: {', '.join(f'{n} {kind}' for kind, n in kinds.items())}."
    yield ""
    yield from HEAD
    yield from (str(line) for line in score.table(done))
    if kinds.get("effect"):
        yield ""
        yield from score.by_strength(done)


def _real(done: Sequence[Done]) -> list[str]:
    if not done:
        return []
    rows = []
    for d in done:
        said = "; ".join(_shown(f) for f in d.findings.findings) or "none"
        rest = d.findings.open_ended.equation.replace("|", "\\|") if d.findings.open_ended else "-"
        extra = "; ".join(d.truth.beyond.values())
        rows.append(f"| {d.arm.what} | {extra} | {d.findings.status} | {said} | {rest} | {d.seconds:.0f} |")
    return [
        "## Recordings of real things and the thesis' estimators, the effect concealed",
        "",
        "| recording | expected | status | findings (95 %) | remainder | s |",
        "|---|---|---|---|---|---|",
        *rows,
        "",
        real.decoded_traffic(real.folder()),
        "There is no licensed public recording of an articulated loader.",
        "",
    ]


def _shown(f) -> str:
    e = f.parameters[0]
    value = (
        f"{len(f.parameters)} values"
        if len(f.parameters) > 3
        else f"{e.value:.3g}{_interval(e)} {'' if e.unit == '1' else e.unit}".strip()
    )
    group = f" (or {', '.join(m.effect for m in f.group)})" if f.group else ""
    return f"{'' if f.named else 'proxy: '}{f.effect} {value}{group}"


def _interval(e) -> str:
    return "" if e.low is None or e.high is None else f" [{e.low:.3g}, {e.high:.3g}]"
