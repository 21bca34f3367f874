"""A diagnosis in sentences."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from html import escape

from discrepancy.findings import Estimate, Finding, Findings, OpenEquation, Where
from discrepancy.words import SHOWN_CHANNELS, UNCHANGED, counted, likelihood, number_and_unit, times
from hil.diagnose.page.mathml import added
from hil.diagnose.page.tables import definitions


def lead(result: Findings) -> str:
    """The one paragraph a reader takes away."""
    named = [f for f in result.findings if f.named]
    if named:
        told = "; ".join(f"{f.effect}: {clause(f.sentence)}" for f in named)
        lowest = min(named[0].held_out_error.items(), key=lambda item: item[1], default=None)
        first = "the first of them" if len(named) > 1 else "it"
        return f"The model leaves out {told}." + (
            f" With {first} the error of {lowest[0]} on data not fitted falls to {percent(lowest[1])}."
            if lowest
            else ""
        )
    if result.status == "unknown":
        seen = (
            f" It depends on {', '.join(result.open_ended.depends_on)}."
            if result.open_ended and result.open_ended.depends_on
            else ""
        )
        return f"The recordings hold something that the model does not, and no effect of the library is its cause.{seen}"
    if result.status == "nothing missing":
        blind = sum(c.verdict == "could not be judged" for c in result.candidates)
        unseen = (
            f" {blind} of {len(result.candidates)} effects these recordings could not have shown."
            if blind
            else ""
        )
        return f"No effect of the library and no function of the known signals improves the prediction of data that was not fitted.{unseen}"
    return f"No verdict is possible: {result.reasons[0].rstrip('.')}."


def summary(result: Findings) -> str:
    """The verdict in figures, for its card."""
    named, proxies = len(result.named), len(result.findings) - len(result.named)
    told = [f"{counted(named, 'effect')} named"] if named else []
    more = f"{proxies} more" if named else counted(proxies, "effect")
    told += [f"{more} {'helps' if proxies == 1 else 'help'} without being the cause"] if proxies else []
    told += ["something that the library does not hold remains"] if result.open_ended else []
    verdicts = Counter(c.verdict for c in result.candidates)
    told += [f"{verdicts[v]} {v}" for v in ("ruled out", "could not be judged") if verdicts[v]]
    text = "; ".join(told)
    return text[:1].upper() + text[1:]


def percent(share: float) -> str:
    """'18 %', which no line is broken in; a rest is never told as nothing."""
    whole = round(100 * share)
    rest = (
        "under 1" if whole == 0 and share > 0.0 else "over 99" if whole == 100 and share < 1.0 else f"{whole}"
    )
    return f"{rest} %".replace(" ", "\N{NO-BREAK SPACE}")


def told_kind(f: Finding) -> str:
    """'sensor of gyro', 'physics · steering servo'."""
    return f.place if f.kind in f.place else f"{f.kind} · {f.place}"


def clause(text: str) -> str:
    """A library's sentence within another: no full stop, no capital."""
    text = text.rstrip(".")
    return text if text[:2].isupper() else text[:1].lower() + text[1:]


def sentence(text: str) -> str:
    """With a full stop, and a capital unless it begins with a channel's name."""
    first = text.partition(" ")[0]
    return f"{text if '_' in first else text[:1].upper() + text[1:]}".rstrip(".") + "."


def better(errors: Mapping[str, float]) -> str:
    """'gyro error × 0.18; others unchanged', best first; of many channels the best and the worst."""
    ranked = sorted(
        ((c, r) for c, r in errors.items() if abs(r - 1.0) >= UNCHANGED), key=lambda item: item[1]
    )
    best, rest = ranked[:SHOWN_CHANNELS], ranked[SHOWN_CHANNELS:]
    told = [f"{c} error {times(r)}" for c, r in best]
    if rest:
        told.append(f"{counted(len(rest), 'more channel')} {times(rest[0][1])} to {rest[-1][1]:.2f}")
    same = len(errors) - len(ranked)
    return "; ".join([*told, *(["others unchanged" if told else "no channel changes"] if same else [])])


def told_where(where: Where) -> str:
    """Channels, time and regime of the evidence."""
    channels = ", ".join(f"{c} {percent(s)}" for c, s in where.channels.items() if s > 0.05)
    spans = "; ".join(
        f"{i.recording} {i.start_s:.1f} to {i.end_s:.1f} s ({percent(i.share)})" for i in where.intervals[:3]
    )
    time = "throughout" if where.throughout or not spans else f"mostly in {spans}"
    regime = (
        f"; densest where {where.regimes[0].text} ({where.regimes[0].density:.1f} times the average)"
        if where.regimes
        else ""
    )
    return f"{channels}; {time}{regime}"


def open_cards(found: OpenEquation) -> Iterator[str]:
    """What functions of the known signals explain beyond the library, a card per place."""
    for place in dict.fromkeys(t.place for t in found.terms):
        terms = [t for t in found.terms if t.place == place]
        facts = {
            f"c{i}": number_and_unit(
                Estimate(name=f"c{i}", value=t.coefficient, low=t.low, high=t.high, unit=t.unit)
            ).partition(" = ")[2]
            + (f"; as good on these data: {', '.join(t.equally_good[:3])}" if t.equally_good else "")
            for i, t in enumerate(terms, 1)
        }
        facts["evidence, all terms"] = (
            f"{likelihood(found.gain)}, needed {found.needed:.0f}; {likelihood(found.held_out_gain)} on held-out data"
        )
        depends = [name for name in found.depends_on if any(_names(t.function, name) for t in terms)]
        yield (
            f'<article class="finding open"><h3>Outside the library<small>at {escape(place)}</small></h3>'
            f"<p>Depends on {escape(', '.join(depends) or 'nothing known: a constant')}.</p>{added(place, [t.function for t in terms], found.depends_on)}{definitions(facts)}</article>"
        )


def _names(function: str, signal: str) -> bool:
    """Whether the text of a function names a signal, and not only a longer one."""
    return re.search(rf"(?<!\w){re.escape(signal)}(?![A-Za-z_\d])", function) is not None
