"""Computes the figures of the proof from its rows, beside their targets."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta, norm

from bench.proof.arm import EXACT, LAMBDAS, LOADERS, STRONG, Done
from bench.proof.stamps import KINDS
from discrepancy.signals.adequacy import inadequate

COIN = 1.0  # likelihood difference below which a coin may as well decide
NEARLY = 0.8  # of the largest true share, from which a channel counts as the main one
REGIMES = {
    "reverse drag": ("speed below",),
    "brake fade": ("brake_force above",),
    "quadratic drag": ("speed above", "speed below"),
}
"""Effects of the straight drive that act in one regime by their equation, and what is to be said of it."""


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many."""

    hits: int
    of: int

    def __str__(self) -> str:
        """With Wilson's 95 % interval."""
        if not self.of:
            return "none run"
        low, high = wilson(self.hits, self.of)
        return f"{self.hits} of {self.of} ({100 * self.hits / self.of:.0f} %; {100 * low:.0f} to {100 * high:.0f})"


@dataclass(frozen=True, slots=True)
class Line:
    """A row of the table; met: None where nothing can be said."""

    metric: str
    target: str
    measured: str
    met: bool | None = None

    def __str__(self) -> str:
        met = "" if self.met is None else "yes" if self.met else "**no**"
        return f"| {self.metric} | {self.target} | {self.measured} | {met} |"


def wilson(hits: int, of: int) -> tuple[float, float]:
    """Wilson's score interval of a proportion, 95 %."""
    z = float(norm.ppf(0.975))
    p, n = hits / of, float(of)
    middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z * np.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / (1.0 + z * z / n)
    return max(0.0, middle - half), min(1.0, middle + half)


def upper_bound(hits: int, of: int) -> float:
    """One-sided 95 % bound of a proportion (Clopper and Pearson)."""
    return float(beta.ppf(0.95, hits + 1, of - hits)) if hits < of else 1.0


def share(runs: Iterable[Done], hit: Callable[[Done], bool]) -> Share:
    """How many of the runs are as they should be."""
    hits = [hit(run) for run in runs]
    return Share(sum(hits), len(hits))


def found(run: Done) -> bool:
    """Whether every hidden effect is in a named group."""
    return all(run.group_has(effect) for effect in run.arm.effects)


def first(run: Done) -> bool:
    """Whether the finding with most evidence is the hidden effect."""
    findings = run.findings.findings
    return bool(findings) and findings[0].effect == run.arm.effects[0]


def tied(run: Done) -> bool:
    """Whether the hidden effect explains the recording as well as the finding with most evidence, but for a coin's throw."""
    rivals = [m for f in run.findings.findings[:1] for m in f.group]
    return any(m.effect == run.arm.effects[0] and m.likelihood_difference < COIN for m in rivals)


def unjudged(run: Done) -> bool:
    """Whether the findings say that these recordings cannot show a hidden effect."""
    return any(
        c.effect in run.arm.effects and c.verdict == "could not be judged" for c in run.findings.candidates
    )


def falsely(run: Done) -> bool:
    """Whether something is named that is neither hidden nor in a group with what is."""
    hidden = set(run.arm.effects)
    return any(f.named and not hidden & {*f.members} for f in run.findings.findings)


def over_budget(run: Done) -> bool:
    """Whether the errors of some channel are beyond their budget."""
    return bool(inadequate(run.findings.adequacy))


def right(run: Done) -> bool:
    """Whether an arm ended as it should; weak effects may be missed but not misnamed."""
    if run.arm.kind in ("null", "outside"):
        return not run.named
    reached = run.arm.strength if run.truth.reached is None else run.truth.reached
    # missing a weak effect is no failure; a false name is one at any strength
    weak = run.arm.kind in ("effect", "pair") and reached < STRONG
    return not falsely(run) and (weak or found(run))


def table(done: Sequence[Done]) -> Iterator[Line]:
    """The metrics of one body; arms with other stamps than the model's grid have lines of their own."""
    gridded = [d for d in done if not d.arm.stamps]
    of = {
        kind: [d for d in gridded if d.arm.kind == kind]
        for kind in ("null", "effect", "outside", "pair", "interval")
    }
    strong = [d for d in of["effect"] if d.lam >= STRONG]
    exact = [d for d in strong if d.lam >= EXACT]
    at = ", lambda >= 50"
    yield from _nulls(of["null"])
    if strong:
        hits = share(strong, found)
        sizes = [1 + len(f.group) for d in strong for f in d.findings.findings if f.named]
        mean = float(np.mean(sizes)) if sizes else float("nan")
        # the group and not the first name: rivals that fit as well are an honest answer
        yield Line(f"truth in the reported group{at}", ">= 95 %", str(hits), hits.hits >= 0.95 * hits.of)
        missed = [d for d in strong if not found(d)]
        yield Line("of those missed, said that they could not be judged", "", str(share(missed, unjudged)))
        yield Line("mean size of a group", "<= 1.5", f"{mean:.2f}", mean <= 1.5)
        tops = share(strong, first)
        yield Line(f"top-1{at}", ">= 85 %", str(tops), tops.hits >= 0.85 * tops.of)
        rest = [d for d in strong if not first(d)]
        yield Line("of the others tied with the first", "", str(share(rest, tied)))
        yield Line("a further, false name beside the truth", "", str(share(strong, falsely)))
        named = [d for d in strong if d.named]
        part = share(named, lambda d: d.findings.status == "explained in part")
        yield Line("of those with a name explained in part only", "", str(part))
    yield from _outside(of["outside"])
    yield from _sizes(strong, exact)
    yield from _places(strong, of["interval"])
    if pairs := [d for d in of["pair"] if d.arm.body not in LOADERS or d.lam >= EXACT]:
        both = share(pairs, found)
        yield Line(
            "two effects, both in groups, lambda >= 250",
            ">= 90 %",
            str(both),
            both.hits >= 0.9 * both.of,
        )
    closed = [
        f.gap_closed for d in strong for f in d.findings.findings if f.named and f.effect in d.arm.effects
    ]
    if closed:
        yield Line(
            "held-out gap closed when named",
            "median >= 0.9",
            f"{np.median(closed):.2f}",
            bool(np.median(closed) >= 0.9),
        )
    for kind, how in KINDS.items():
        yield from _stamped([d for d in done if d.arm.stamps == kind], how)
    seconds = [d.seconds for d in done]
    yield Line("time of a diagnosis", "", f"median {np.median(seconds):.1f} s, longest {max(seconds):.0f} s")


def _stamped(done: Sequence[Done], how: str) -> Iterator[Line]:
    """The same questions of arms whose readings and commands come between the points of the model's grid."""
    nulls = [d for d in done if d.arm.kind == "null"]
    strong = [d for d in done if d.arm.kind == "effect" and d.lam >= STRONG]
    if nulls:
        false = share(nulls, lambda d: bool(d.named))
        yield Line(
            f"stamps {how}: false findings on nulls", "<= 3 %", str(false), false.hits <= 0.03 * false.of
        )
        clean = share(nulls, lambda d: d.findings.status == "nothing missing")
        yield Line(f"stamps {how}: nulls called 'nothing missing'", "", str(clean))
    if strong:
        hits = share(strong, found)
        yield Line(
            f"stamps {how}: truth in the reported group", ">= 95 %", str(hits), hits.hits >= 0.95 * hits.of
        )
        yield Line(f"stamps {how}: a further, false name beside the truth", "", str(share(strong, falsely)))
        held = [c for d in strong for _, c in parameters(d)]
        yield Line(f"stamps {how}: coverage of 95 % intervals", "92-98 %", str(Share(sum(held), len(held))))


def _nulls(nulls: Sequence[Done]) -> Iterator[Line]:
    if not nulls:
        return
    false = share(nulls, lambda d: bool(d.named))
    bound = upper_bound(false.hits, false.of)
    yield Line(
        "false findings on nulls",
        "<= 3 %, 95 % upper bound < 5 %",
        f"{false}, upper bound {100 * bound:.1f} %",
        false.hits <= 0.03 * false.of and bound < 0.05,
    )
    for noise in dict.fromkeys(d.arm.noise for d in nulls if d.arm.noise):
        yield Line(
            f"of these with {noise} noise",
            "",
            str(share([d for d in nulls if d.arm.noise == noise], lambda d: bool(d.named))),
        )
    yield Line(
        "nulls called 'unknown' (no name is given)",
        "",
        str(share(nulls, lambda d: d.findings.status == "unknown")),
    )
    judged = [d for d in nulls if d.findings.adequacy]
    yield Line("nulls of which some channel is called inadequate", "", str(share(judged, over_budget)))


def _outside(outside: Sequence[Done]) -> Iterator[Line]:
    if not outside:
        return
    wrong = share(outside, lambda d: bool(d.named))
    yield Line(
        "out of library: no name, or 'unknown'",
        ">= 90 %, wrong name <= 5 %",
        f"{Share(wrong.of - wrong.hits, wrong.of)}; wrong name {wrong}",
        wrong.hits <= 0.05 * wrong.of,
    )
    yield Line(
        "of these said to be unknown", "", str(share(outside, lambda d: d.findings.status == "unknown"))
    )


def _sizes(strong: Sequence[Done], exact: Sequence[Done]) -> Iterator[Line]:
    errors, covered = (
        [e for d in exact for e, _ in parameters(d)],
        [c for d in strong for _, c in parameters(d)],
    )
    if errors:
        middle = float(np.median(errors))
        yield Line("parameter error, lambda >= 250", "median <= 5 %", f"{100 * middle:.1f} %", middle <= 0.05)
    if covered:
        held = Share(sum(covered), len(covered))
        yield Line("coverage of 95 % intervals", "92-98 %", str(held), 0.92 <= held.hits / held.of <= 0.98)


def parameters(run: Done, *, named: bool = False) -> Iterator[tuple[float, bool]]:
    """Relative error and coverage of every parameter of the hidden effects that were found under their own name; named: not as a proxy."""
    for f in run.findings.findings:
        if f.effect not in run.arm.effects or (named and not f.named):
            continue
        for e in f.parameters:
            true = run.truth.values.get(e.name)
            # a relative error of a true zero has no meaning
            if true:
                low, high = (-np.inf if e.low is None else e.low), (np.inf if e.high is None else e.high)
                yield abs(e.value - true) / abs(true), bool(low <= true <= high)


def _places(strong: Sequence[Done], intervals: Sequence[Done]) -> Iterator[Line]:
    channels = [channel_right(d) for d in strong]
    judged = [c for c in channels if c is not None]
    if judged:
        hits = Share(sum(judged), len(judged))
        yield Line(
            "location: the channel, of effects found", ">= 95 %", str(hits), hits.hits >= 0.95 * hits.of
        )
    if intervals:
        overlaps = [overlap(d) for d in intervals]
        middle = float(np.median(overlaps))
        yield Line(
            "location: interval of an effect that acts for a while, IoU",
            "median >= 0.7",
            f"median {middle:.2f}, {sum(o >= 0.7 for o in overlaps)} of {len(overlaps)} at least 0.7; not found counts 0",
            middle >= 0.7,
        )
    regimes = [r for d in strong if (r := regime_right(d)) is not None]
    if regimes:
        hits = Share(sum(regimes), len(regimes))
        yield Line(
            "location: the regime, of effects with one", ">= 90 %", str(hits), hits.hits >= 0.9 * hits.of
        )


def channel_right(run: Done) -> bool | None:
    """Whether the channel with most evidence is the main one, or nearly; None where the effect was not found."""
    f = next((f for f in run.findings.findings if f.effect in run.arm.effects), None)
    if f is None or not run.truth.channels:
        return None
    # sorted by evidence
    strongest = next(iter(f.where.channels))
    return run.truth.channels.get(strongest, 0.0) >= NEARLY * max(run.truth.channels.values())


def overlap(run: Done) -> float:
    """Intersection over union of the reported active interval with the true one; 0 where the effect was not found."""
    f = next(
        (f for f in run.findings.findings if run.arm.effects[0] in f.members),
        None,
    )
    start, end = run.arm.start_s, run.arm.end_s
    if f is None or not f.where.intervals or start is None or end is None:
        return 0.0
    found_at = f.where.intervals[0]
    common = max(0.0, min(end, found_at.end_s) - max(start, found_at.start_s))
    return common / (max(end, found_at.end_s) - min(start, found_at.start_s))


def regime_right(run: Done) -> bool | None:
    """Whether the regime in which the effect acts by its equation is among those reported."""
    expected = REGIMES.get(run.arm.effects[0]) if run.arm.body == "straight" else None
    f = next((f for f in run.findings.findings if f.effect == run.arm.effects[0]), None)
    if expected is None or f is None:
        return None
    return any(regime.text.startswith(expected) for regime in f.where.regimes)


def by_strength(done: Sequence[Done]) -> Iterator[str]:
    """One row per lambda, the peer's answers beside ours."""
    effects = [d for d in done if d.arm.kind == "effect" and not d.arm.stamps]
    peers = list(dict.fromkeys(name for d in effects for name in d.truth.beyond))
    head = [
        "lambda",
        "arms" if any(d.arm.body in LOADERS for d in effects) else "reached",
        "in group",
        "top-1",
        "false name",
        *(f"{p}, top-1 at its best threshold" for p in peers),
    ]
    yield f"| {' | '.join(head)} |"
    yield "|" + "---|" * len(head)
    for strength, some, arms in _by_lambda(effects):
        cells = [
            strength,
            arms,
            str(share(some, found)),
            str(share(some, first)),
            str(share(some, falsely)),
        ]
        cells += [
            str(share(some, lambda d, p=p: d.arm.effects[0] in d.truth.beyond.get(p, "").split(", ")))
            for p in peers
        ]
        yield f"| {' | '.join(cells)} |"


def _by_lambda(effects: Sequence[Done]) -> Iterator[tuple[str, list[Done], str]]:
    """Arms of about the same lambda, with how they are called and how many they are."""
    if not any(d.arm.body in LOADERS for d in effects):
        for strength in LAMBDAS:
            # by the wanted lambda; arms that did not reach it are in the second column, and in no share
            wanted = [d for d in effects if d.arm.strength == strength]
            some = [d for d in wanted if d.reached]
            yield f"{strength:g}", some, f"{len(some)} of {len(wanted)}"
        return
    edges = (-np.inf, LAMBDAS[0], STRONG, EXACT, np.inf)
    names = ("below 10", "10 to 50", "50 to 250", "250 and more")
    for name, low, high in zip(names, edges[:-1], edges[1:], strict=True):
        some = [d for d in effects if low <= d.lam < high]
        yield name, some, str(len(some))


def failures(done: Sequence[Done]) -> Iterator[str]:
    """Every arm that did not end as it should, and the loader's weak ones that were missed; with what was said."""
    for d in done:
        if d.arm.kind == "real":
            continue
        # the loader's arms have sizes, not lambdas: a weak one that was missed is listed, for a reader to judge
        if not right(d) or (d.arm.body in LOADERS and not found(d)):
            findings = "; ".join(
                f"{f.effect}{'' if f.named else ' (proxy)'}"
                + (f" [or {', '.join(m.effect for m in f.group)}]" if f.group else "")
                + (f" because {'; '.join(f.caveats)}" if f.caveats else "")
                for f in d.findings.findings
            )
            hidden = ", ".join(f"{k} = {v:.4g}" for k, v in d.truth.values.items()) or "nothing"
            lam = f"{d.truth.reached:.0f}" if d.truth.reached is not None else f"{d.arm.strength:g}"
            yield f"| {d.arm.key} | {lam} | {hidden} | {d.findings.status}: {findings or reason(d)} |".replace(
                "\n", " "
            )


def reason(run: Done) -> str:
    """Why a hidden effect was not taken, by the results of the screen."""
    reasons = [
        f"{c.effect}: {c.verdict}, {c.reason}" for c in run.findings.candidates if c.effect in run.arm.effects
    ]
    return f"no effect ({'; '.join(reasons)})" if reasons else "no effect"
