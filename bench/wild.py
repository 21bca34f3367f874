"""Diagnosis of truths that differ from the model in structure, as every real machine does.

    python -m bench.wild [--seeds tuning|report] [--bodies straight,ball,car] [--share 0.1] [--out docs/results/wild.md]
    LOADERHIL_EFFECTS=bench/wild_effects python -m bench.wild --bodies loader --out docs/results/wild-loader.md

Some 200 arms a small body, 60 of the loader. Rules of the engine are changed by what the tuning seeds show; the page is made of the report seeds.
"""

import argparse
import os
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from bench.proof import report, wild, wild_loader
from bench.proof.arm import STRONG, Done, read
from bench.proof.plan import sampled
from bench.proof.score import Share, found, parameters, share
from diagnosis.fleet.cluster import carry_out
from diagnosis.fleet.fleet import bar
from diagnosis.fleet.store import Store

HEAD = (
    "Each drive has two differences from the model beside what is hidden: another law, or another sensor's vice, drawn by chance. A difference that comes near an effect of the",
    "library has that effect as a *fair name*: a resistance that goes with a higher power of speed may be called quadratic drag. A name that is neither hidden nor fair is false.",
    "lambda is that of the effect without the differences ([proof](proof.md) says how it is measured). Beside them it is smaller where what they do looks like noise: outliers, pictures at",
    "other times. That value is measured by the same oracle, which knows the effect but not the differences. Shares have Wilson's 95 % interval.",
)


def false_names(run: Done) -> list[str]:
    """Named findings of which no member of the group is hidden, or a fair name."""
    right = wild.fair(run.arm)
    twins = {f"{name} twin" for name in run.arm.effects} if run.arm.kind == "twin" else set()
    return [f.effect for f in run.findings.findings if f.named and not (right | twins) & {*f.members}]


def grouped_twins(run: Done) -> bool:
    """Whether the effect and its twin are reported as one group."""
    both = {run.arm.effects[0], f"{run.arm.effects[0]} twin"}
    return any(both <= {*f.members} for f in run.findings.findings)


Cell = tuple[str, bool | None]


def _share(part: Share, least: float = 0.0, most: float = 1.0) -> Cell:
    return str(part), least * part.of <= part.hits <= most * part.of if part.of else None


def measured(done: Sequence[Done]) -> dict[str, Cell]:
    """The metrics of one body: what was measured, and whether it meets the target."""
    of = {kind: [d for d in done if d.arm.kind == kind] for kind in ("null", "effect", "pair", "twin")}
    strong = [d for d in of["effect"] if d.lam >= STRONG]
    visible = [d for d in strong if (d.truth.beside or 0.0) >= STRONG]
    covered = [inside for d in strong for _, inside in parameters(d)]
    named = [inside for d in strong for _, inside in parameters(d, named=True)]
    beside = [len(false_names(d)) for d in strong]
    pairs = [d for d in of["pair"] if d.reached]
    return {
        "nothing hidden: a wrong name": _share(share(of["null"], lambda d: bool(false_names(d))), most=0.05),
        "of these with a fair name": _share(share(of["null"], _fairly_named)),
        "one effect hidden, lambda >= 50: in a named group": _share(share(strong, found), least=0.9),
        "of these with its name first in the group": _share(
            share(strong, lambda d: bool(set(d.named) & set(d.arm.effects)))
        ),
        "of those with lambda >= 50 beside the differences too: in a named group": _share(
            share(visible, found)
        ),
        "of the same: said that nothing is missing": _share(
            share(visible, lambda d: d.findings.status == "nothing missing"), most=0.03
        ),
        "its 95 % interval holds": _share(Share(sum(covered), len(covered)), 0.9, 0.98),
        "of these, where it is named and no proxy": _share(Share(sum(named), len(named))),
        "false names beside it, per recording": (
            f"{np.mean(beside):.2f}" if beside else "none run",
            float(np.mean(beside)) <= 0.1 if beside else None,
        ),
        "recordings with a false name beside it": _share(share(strong, lambda d: bool(false_names(d)))),
        "two effects, both in groups": _share(share(pairs, found)),
        "exact twins reported as a group, where one is found": _share(
            share([d for d in of["twin"] if d.findings.findings], grouped_twins), least=1.0
        ),
        "verdicts, nothing hidden": (_statuses(of["null"]), None),
        "verdicts, one effect hidden": (_statuses(strong), None),
    }


TARGETS = {
    "nothing hidden: a wrong name": "<= 5 %",
    "one effect hidden, lambda >= 50: in a named group": ">= 90 %",
    "of the same: said that nothing is missing": "<= 3 %",
    "its 95 % interval holds": "90-98 %",
    "false names beside it, per recording": "<= 0.1",
    "exact twins reported as a group, where one is found": "100 %",
}


def _fairly_named(run: Done) -> bool:
    return bool(run.named) and not false_names(run)


def _statuses(done: Iterable[Done]) -> str:
    counts = Counter(d.findings.status for d in done)
    return ", ".join(f"{n} {status}" for status, n in counts.most_common())


def page(done: Sequence[Done], broken: dict[str, str], planned: int, command: str, commit: str) -> str:
    """The page of Markdown."""
    bodies = [name for name in wild.DIFFERENCES_OF if any(d.arm.body == name for d in done)]
    cells = {name: measured([d for d in done if d.arm.body == name]) for name in bodies}
    whom = " of the whole loader" if bodies == [wild_loader.BODY] else ""
    lines = [
        f"# Diagnosis{whom} where the truth differs from the model in structure",
        "",
        f"`{command}`, commit {commit}; {len(done)} of {planned} arms, {sum(d.seconds for d in done) / 3600.0:.1f} h of diagnosis.",
        "",
        *HEAD,
        "",
        f"| metric | target | {' | '.join(name.removeprefix('wild ') for name in bodies)} |",
        "|---|---|" + "---|" * len(bodies),
    ]
    for metric in next(iter(cells.values()), {}):
        row = [
            f"{text}{'' if met is not False else ' **missed**'}"
            for text, met in (cells[b][metric] for b in bodies)
        ]
        lines.append(f"| {metric} | {TARGETS.get(metric, '')} | {' | '.join(row)} |")
    for title, rows in (
        ("By difference", by_difference(done)),
        ("By strength", by_strength(done)),
        ("Every false name and every strong effect that was missed", failures(done)),
    ):
        lines += ["", f"## {title}", "", *rows]
    if broken:
        lines += ["", "## Not finished", "", *(f"- {key}: {why}" for key, why in broken.items())]
    return "\n".join(lines) + "\n"


def by_difference(done: Sequence[Done]) -> Iterator[str]:
    """For each difference: how often it is there, and how often there was a false name."""
    yield "| body | difference | fair names | nothing hidden: wrong name | one effect: false name beside it | one effect: in a named group |"
    yield "|---|---|---|---|---|---|"
    for body, possible in wild.DIFFERENCES_OF.items():
        for difference in possible:
            mine = [d for d in done if d.arm.body == body and difference in wild.differences(d.arm)]
            null = [d for d in mine if d.arm.kind == "null"]
            strong = [d for d in mine if d.arm.kind == "effect" and d.lam >= STRONG]
            if mine:
                cells = [
                    share(null, lambda d: bool(false_names(d))),
                    share(strong, lambda d: bool(false_names(d))),
                    share(strong, found),
                ]
                shown = " | ".join(f"{c.hits} of {c.of}" for c in cells)
                fair = ", ".join(difference.fair) or "none"
                yield f"| {body.removeprefix('wild ')} | {difference.name} | {fair} | {shown} |"


def by_strength(done: Sequence[Done]) -> Iterator[str]:
    """In a named group, by body and lambda; the loader's effects have a size, so that its lambdas lie from each value to the next."""
    bands = dict(zip(wild.STRENGTHS, (*wild.STRENGTHS[1:], np.inf), strict=True))
    yield f"| body | {' | '.join(f'lambda {low:g}' for low in bands)} |"
    yield "|---|" + "---|" * len(bands)
    for body in wild.DIFFERENCES_OF:
        mine = [d for d in done if d.arm.body == body and d.arm.kind == "effect"]
        cells = [str(share([d for d in mine if low <= d.lam < high], found)) for low, high in bands.items()]
        if mine:
            yield f"| {body.removeprefix('wild ')} | {' | '.join(cells)} |"


def failures(done: Sequence[Done]) -> Iterator[str]:
    """What went wrong, arm by arm."""
    yield "| body, kind, seed | hidden | differences | verdict |"
    yield "|---|---|---|---|"
    for d in done:
        missed = d.arm.kind == "effect" and d.lam >= STRONG and not found(d)
        if false_names(d) or missed:
            said = "; ".join(
                f"{'' if f.named else 'proxy: '}{f.effect}"
                + (f" [or {', '.join(m.effect for m in f.group)}]" if f.group else "")
                for f in d.findings.findings
            )
            where = f"{d.arm.body.removeprefix('wild ')} {d.arm.kind} {d.arm.seed}, {d.arm.noise}"
            hidden = (
                ", ".join(
                    f"{name} (lambda {d.lam:.0f}, beside {d.truth.beside or 0.0:.0f})"
                    for name in d.arm.effects
                )
                or "nothing"
            )
            yield f"| {where} | {hidden} | {d.arm.what} | {d.findings.status}: {said or 'no name'} |"


def main() -> None:
    """Carry out the arms that are left, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m bench.wild", description=__doc__)
    parser.add_argument("--seeds", choices=tuple(wild.SEEDS), default="tuning")
    parser.add_argument("--bodies", default=",".join(body.name for body in wild.BODIES.values()))
    parser.add_argument("--share", type=float, default=1.0, help="of the arms, evenly from each kind")
    parser.add_argument(
        "--work",
        type=Path,
        default=None,
        help="keeps each arm's result; default: a folder of the commit below out/wild",
    )
    parser.add_argument("--out", type=Path, default=None, help="write the page here, else print it")
    parser.add_argument("--workers", type=int, default=None, help="processes; else one per processor")
    args = parser.parse_args()
    names = [f"wild {name}" for name in args.bodies.split(",")]
    if strange := [name for name in names if name not in wild.DIFFERENCES_OF]:
        parser.error(f"--bodies {strange[0].removeprefix('wild ')}: there are straight, ball, car, loader")
    planned = sampled([arm for name in names for arm in wild.arms(name, wild.SEEDS[args.seeds])], args.share)
    chosen = {arm.key: arm for arm in planned}
    commit = report.commit()
    store = Store(args.work or Path("out/wild") / f"{args.seeds} {commit}", {"commit": commit})
    with bar(Console(stderr=True)) as progress:
        broken = carry_out(wild.carried_out, chosen, store, workers=args.workers, report=progress).failures
    store.collect(chosen, broken)
    options = [
        f"--{name}={value}"
        for name in ("seeds", "bodies", "share")
        if (value := getattr(args, name)) != parser.get_default(name)
    ]
    # the loader's differences are effects of the plant
    effects = [f"LOADERHIL_EFFECTS={folder}"] if (folder := os.environ.get("LOADERHIL_EFFECTS")) else []
    text = page(
        [read(row) for row in store.rows(chosen)],
        broken,
        len(chosen),
        shlex.join([*effects, "python", "-m", "bench.wild", *options]),
        commit,
    )
    report.publish(text, args.out)


if __name__ == "__main__":
    main()
