"""A diagnosis in sentences."""

from collections.abc import Iterator, Mapping
from html import escape

from discrepancy.findings import Findings, OpenEquation, Where
from hil.diagnose.page.mathml import added
from hil.diagnose.page.tables import definitions


def lead(result: Findings) -> str:
    """The one paragraph a reader takes away."""
    named = [f for f in result.findings if f.named]
    if named:
        told = "; ".join(f"{f.effect}: {f.sentence}" for f in named)
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
        return "No effect of the library and no function of the known signals improves the prediction of data that was not fitted."
    return "No verdict: " + "; ".join(result.reasons) + "."


def summary(result: Findings) -> str:
    """The verdict in figures, for its card."""
    named, proxies = len(result.named), len(result.findings) - len(result.named)
    told = [f"{named} {'effect' if named == 1 else 'effects'} named"] if named else []
    told += (
        [f"{proxies} more {'helps' if proxies == 1 else 'help'} without being the cause"] if proxies else []
    )
    told += ["something that the library does not hold remains"] if result.open_ended else []
    text = "; ".join(told) or "; ".join(result.reasons)
    return text[:1].upper() + text[1:]


def percent(share: float) -> str:
    """'18 %'."""
    return f"{100 * share:.0f} %"


def better(errors: Mapping[str, float]) -> str:
    """'gyro error × 0.18; encoder unchanged', best first."""
    ranked = sorted(errors.items(), key=lambda item: item[1])
    changed = [f"{c} error × {r:.2f}" for c, r in ranked if abs(r - 1.0) >= 0.005]
    same = [c for c, r in errors.items() if abs(r - 1.0) < 0.005]
    return "; ".join([*changed, *([f"{', '.join(same)} unchanged"] if same else [])])


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


def interval(low: float | None, high: float | None) -> str:
    """'95 %: 0.1 to 0.2', or nothing."""
    return "" if low is None or high is None else f"95 %: {low:.4g} to {high:.4g}"


def open_cards(found: OpenEquation) -> Iterator[str]:
    """What functions of the known signals explain beyond the library, a card per place."""
    for place in dict.fromkeys(t.place for t in found.terms):
        terms = [t for t in found.terms if t.place == place]
        facts = {
            f"c{i}": f"{t.coefficient:.4g} {t.unit} ({interval(t.low, t.high)})"
            + (f"; as good on these data: {', '.join(t.equally_good[:3])}" if t.equally_good else "")
            for i, t in enumerate(terms, 1)
        }
        facts["evidence, all terms"] = (
            f"{found.gain:.0f}, needed {found.needed:.0f}; {found.held_out_gain:.0f} on held-out data"
        )
        yield (
            f'<article class="finding open"><h3>Outside the library<small>at {escape(place)}</small></h3>'
            f"<p>Depends on {escape(', '.join(found.depends_on) or 'nothing known: a constant')}.</p>{added(place, [t.function for t in terms])}{definitions(facts)}</article>"
        )
