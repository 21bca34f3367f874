"""What to do after a diagnosis: one sentence per step, the most pressing first, with the commands as they would be typed."""

from collections.abc import Iterator
from pathlib import Path
from shlex import quote

from discrepancy.findings import Finding, Findings
from discrepancy.words import number_and_unit

SHOWN = 4  # members of a list in one sentence
OTHER_CHANNEL = "another channel"
NEEDS = "; needs "  # how the reasons of candidates that could not be judged name what would show them


def advice(result: Findings, model: str, out: Path | None, *, applied: bool = False) -> list[str]:
    """Steps; commands stand between backticks. model, out: as on the command line; applied: what was found is already in a file."""
    steps = [*_mended(result), *_checked(result), *_separated(result), *_named(result, model, out)]
    if any(f.named for f in result.findings) and not applied:
        steps.append(
            "Keep what was found: the same command with `--apply FILE.toml` writes the model extended by it; "
            "with `--with FILE.toml` the next diagnosis tells only what is still missing."
        )
    if result.status == "unknown" and len(result.recordings) > 1:
        steps.append(
            "If the recordings are not of one machine in one state, `--each` judges every one by itself."
        )
    return [*steps, *_recorded(result)]


def _mended(result: Findings) -> Iterator[str]:
    """Recordings first: what is wrong with them decides what the rest is worth."""
    wrong = list(dict.fromkeys(f"{c.recording} {c.signal}".strip() for c in result.complaints if c.fatal))
    if wrong:
        yield f"Mend and diagnose again: {_some(wrong)}; what is wrong, and what would help, is told of each."


def _checked(result: Findings) -> Iterator[str]:
    for f in [f for f in result.findings if f.named and f.kind == "sensor"]:
        yield f"Check the {f.place}: {f.sentence}{_size(f)}."
    for f in [f for f in result.findings if not f.named]:
        yield (
            f"Do not take {f.effect} for the cause: it is what the library has that comes nearest. "
            f"Look at what happens where it shows: {_where(f)}."
        )


def _separated(result: Findings) -> Iterator[str]:
    for f in result.findings:
        for way in f.separate_by:
            yield (
                f"To tell {f.effect} from {way.effect}, record this and diagnose it together with what you have: {way.manoeuvre}."
            )


def _named(result: Findings, model: str, out: Path | None) -> Iterator[str]:
    if result.open_ended is None:
        return
    if out is None:
        yield "With `--out DIR` the equation is kept, and `loaderhil effects add DIR` makes an effect of it."
        return
    known = "" if model == "loader" else f" --model {quote(model)}"
    depends, places = result.open_ended.depends_on, dict.fromkeys(t.place for t in result.open_ended.terms)
    what = f"what could depend on {_some(depends)} and act" if depends else "a constant that could act"
    yield (
        f"Look for {what} at {_some(list(places))}. To give the equation a name: "
        f"`loaderhil effects add {quote(str(out))} --name NAME{known} --out NAME.py`."
    )


def _recorded(result: Findings) -> Iterator[str]:
    """What another recording must hold, for effects that this one could not show."""
    by_need: dict[str, list[str]] = {}
    for c in result.candidates:
        if c.verdict == "could not be judged" and NEEDS in c.reason:
            by_need.setdefault(c.reason.partition(NEEDS)[2], []).append(c.effect)
    alike = by_need.pop(OTHER_CHANNEL, [])
    needs = [f"{need} ({_some(effects)})" for need, effects in by_need.items()]
    if needs:
        more = "; and more" if len(needs) > SHOWN else ""
        yield f"To judge what could not be judged, record {'; '.join(needs[:SHOWN])}{more}."
    if alike:
        yield (
            f"No driving tells {_some(alike)} from what the baseline's own parameters can do (a zero point, a mass); "
            "a further channel can."
        )


def _size(f: Finding) -> str:
    return f", {number_and_unit(f.parameters[0])}" if len(f.parameters) == 1 else ""


def _where(f: Finding) -> str:
    channels = [channel for channel, share in f.where.channels.items() if share > 0.05]
    spans = [f"{i.recording} {i.start_s:.1f} to {i.end_s:.1f} s" for i in f.where.intervals[:1]]
    regime = [r.text for r in f.where.regimes[:1]]
    return "; ".join([_some(channels), *([] if f.where.throughout else spans), *regime])


def _some(names: list[str]) -> str:
    return ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
