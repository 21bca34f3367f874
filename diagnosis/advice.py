"""The next steps after a diagnosis, for its reader: one sentence each, the most urgent first, with the commands to type."""

from collections.abc import Iterator
from pathlib import Path
from shlex import quote

from diagnosis.describe import estimate
from discrepancy.signals.adequacy import inadequate
from discrepancy.signals.findings import Finding, Findings
from discrepancy.signals.quantities import quantity, span

SHOWN = 4  # members of a list in one sentence
# The reason of a candidate reads "REASON; needs MANOEUVRE" (discrepancy.decision); where only an additional channel helps, the
# manoeuvre is this text.
NEEDS = "; needs "
OTHER_CHANNEL = "another channel"


def advice(result: Findings, model: str, out: Path | None, *, applied: bool = False) -> list[str]:
    """Steps, with commands between backticks. model, out: as on the command line; applied: whether the findings are already in a file."""
    steps = [
        *_searched_on(result),
        *_mended(result),
        *_checked(result),
        *_widened(result, model),
        *_separated(result),
        *_named(result, model, out),
    ]
    if any(f.named for f in result.findings) and not applied:
        steps.append(
            "Keep the findings: the same command with `--apply FILE.toml` writes the model extended by them; "
            "with `--with FILE.toml` the next diagnosis reports only what is still missing."
        )
    # Two machine states in one set of recordings are a common cause of "unknown": no single value fits both.
    if result.status in ("unknown", "explained in part") and len(result.recordings) > 1:
        steps.append(
            "If the recordings are not of one machine in one state, diagnose each of them alone with `--each`."
        )
    return [*steps, *_left(result), *_recorded(result)]


def _searched_on(result: Findings) -> Iterator[str]:
    """A search that was cut short says little that is worth acting upon."""
    if result.cut_short:
        yield "Search to the end: the same command without `--at-most`, or with more time."


def _left(result: Findings) -> Iterator[str]:
    """What to do about an error that has no name."""
    beyond = inadequate(result.adequacy)
    if not beyond:
        return
    measured = [c.channel for c in beyond if not c.firm]
    yield f"Look at {_some([c.channel for c in beyond])} where the error is beyond its budget, and give the library an effect for it."
    if measured:
        yield (
            f"If the sensors or disturbances of {_some(measured)} are known to be larger, state them in the model "
            "(`sensor_noise`, `disturbances`): their budgets are measured on the recording."
        )


def _mended(result: Findings) -> Iterator[str]:
    """Recordings with errors come first: they decide the value of everything else."""
    wrong = list(dict.fromkeys(f"{c.recording} {c.signal}".strip() for c in result.complaints if c.fatal))
    if wrong:
        yield f"Correct and diagnose again: {_some(wrong)}. The message about each of them states the error and the remedy."


def _checked(result: Findings) -> Iterator[str]:
    """Sensors to check, values to measure, and best proxies that must not be taken as causes."""
    unexplained = bool(inadequate(result.adequacy)) or result.open_ended is not None
    doubt = " If it is right, the effect stands in for what is still missing." if unexplained else ""
    for b in [b for b in result.baseline_values if b.or_effects]:
        yield (
            f"Measure the baseline's {b.estimate.name} by itself: if it is what was assumed, look for {_some(b.or_effects)}."
        )
    for f in [f for f in result.findings if f.named and f.kind == "sensor"]:
        rivals = f" (or instead: {_some([m.effect for m in f.group])})" if f.group else ""
        yield f"Check the {f.place}: {f.sentence}{_size(f)}{rivals}.{doubt}"
    proxies = [f for f in result.findings if not f.named]
    if len(proxies) == 1:
        yield (
            f"Do not take {proxies[0].effect} as the cause: it is only the most similar effect of the library. "
            f"Look for the cause where the difference shows: {_where(proxies[0])}."
        )
    elif proxies:
        yield (
            f"Do not take {_some([f.effect for f in proxies])} as causes: they are only the most similar effects of the library. "
            f"Look for the causes where most of the difference shows: {_where(max(proxies, key=lambda f: f.sse_reduction))}."
        )


def _widened(result: Findings, model: str) -> Iterator[str]:
    """Shapes at an end of their range, in a model of the reader's own."""
    if not Path(model).suffix:
        return
    for f in [f for f in result.findings if f.named]:
        # a shape has no value at which the effect is off; the bounds of other parameters are physics
        for p in [p for p in f.parameters if p.baseline is None and p.at_bound]:
            yield (
                f"Widen the range of {p.name} in the model (`{p.at_bound}`) if it only says where to look: the fit of {f.effect} stopped at its end, "
                f"{quantity(p.value, p.unit)}, and the interval ends there for that reason alone."
            )


def _separated(result: Findings) -> Iterator[str]:
    """Manoeuvres that distinguish the members of a group."""
    for f in result.findings:
        for separation in f.separate_by:
            yield (
                f"To distinguish {f.effect} from {separation.effect}, record this and diagnose it together with the present recordings: {separation.manoeuvre}."
            )


def _named(result: Findings, model: str, out: Path | None) -> Iterator[str]:
    """How to make an effect of an open-ended equation."""
    if result.open_ended is None:
        return
    if out is None:
        yield "With `--out DIR` the equation is saved; `loaderhil effects add DIR` then makes an effect of it."
        return
    known = "" if model == "loader" else f" --model {quote(model)}"
    depends, places = result.open_ended.depends_on, dict.fromkeys(t.place for t in result.open_ended.terms)
    what = f"a cause that depends on {_some(depends)} and acts" if depends else "a constant that acts"
    yield (
        f"Look for {what} at {_some(list(places))}. To give the equation a name: "
        f"`loaderhil effects add {quote(str(out))} --name NAME{known} --out NAME.py`."
    )


def _recorded(result: Findings) -> Iterator[str]:
    """Manoeuvres and channels that another recording needs, for the effects that these recordings could not show."""
    by_need: dict[str, list[str]] = {}
    for c in result.candidates:
        if c.verdict == "could not be judged" and NEEDS in c.reason:
            by_need.setdefault(c.reason.partition(NEEDS)[2], []).append(c.effect)
    alike = by_need.pop(OTHER_CHANNEL, [])
    needs = [f"{need} ({_some(effects)})" for need, effects in by_need.items()]
    if needs:
        more = "; and more" if len(needs) > SHOWN else ""
        yield f"To judge the remaining effects, record {'; '.join(needs[:SHOWN])}{more}."
    if alike:
        yield (
            f"No manoeuvre distinguishes {_some(alike)} from other values of the baseline's own parameters (a zero point, a mass); "
            "an additional channel may."
        )


def _size(f: Finding) -> str:
    return f", {estimate(f.parameters[0])}" if len(f.parameters) == 1 else ""


def _where(f: Finding) -> str:
    channels = [channel for channel, share in f.where.channels.items() if share > 0.05]
    spans = [f"{i.recording} {span(i.start_s, i.end_s)}" for i in f.where.intervals[:1]]
    regime = [r.text for r in f.where.regimes[:1]]
    return "; ".join([_some(channels), *([] if f.where.throughout else spans), *regime])


def _some(names: list[str]) -> str:
    return ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
