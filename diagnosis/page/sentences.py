"""Sentences of the HTML page: the summary, and the facts of a finding."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from diagnosis import describe
from diagnosis.page.tables import definitions
from discrepancy.signals.adequacy import ErrorPart, inadequate, left
from discrepancy.signals.findings import Estimate, Finding, Findings, OpenEquation, Where
from discrepancy.signals.quantities import span
from report.kit.mathml import added

MOST_LEFT = 2  # channels beyond their budget on the card; all of them are in the table below
MOST_CHANNELS = 6  # of those that a finding improves; all of them are in findings.json
SHARE_SHOWN = 0.05  # of the evidence, below which a channel is not listed


def headline(result: Findings) -> str:
    """The first paragraph of the page: the result in one or two sentences."""
    named, several = [f for f in result.findings if f.named], len(result.recordings) > 1
    if named:
        either = describe.value_or_effect(result)
        rest = " That does not explain all of the difference." if result.status == "explained in part" else ""
        rest = f" {either}." if either else rest
        left_out = "; ".join(_left_out(f, several=several) for f in named)
        return f"The model leaves out {left_out}.{_error_falls(named)}{rest}"
    if result.status.startswith("explained"):
        wrong = "; ".join(describe.wrong_values(result))
        return f"A value of the baseline is wrong: {wrong}. Apart from that, no effect and no function of the known signals improves the prediction of held-out data."
    if result.cut_short:
        return sentence(result.reasons[0])
    if result.status == "unknown":
        signals = result.open_ended.depends_on if result.open_ended else []
        depends = f" The difference depends on {', '.join(signals)}." if signals else ""
        return f"Model and recordings differ, and no effect of the library is the cause.{depends}"
    if result.status == "nothing missing":
        blind = sum(c.verdict == "could not be judged" for c in result.candidates)
        unseen = (
            f" {blind} of the {len(result.candidates)} effects would not show in these recordings."
            if blind
            else ""
        )
        return f"No effect of the library and no function of the known signals improves the prediction of held-out data.{unseen}"
    return f"No verdict is possible: {result.reasons[0].rstrip('.')}."


def _left_out(f: Finding, *, several: bool) -> str:
    """'leak: water is lost in proportion to the level', with the effects that could be in its place."""
    rivals = [m.effect for m in f.group]
    instead = f" (or {', or '.join(rivals)}: these recordings cannot distinguish them)" if rivals else ""
    return f"{f.effect}: {clause(f.sentence)}{instead}{describe.only_at(f.where, several=several)}"


def _error_falls(named: Sequence[Finding]) -> str:
    """By how much the first finding lowers the error of the channel that gains most."""
    # the other channels of a finding hardly change, and an average over them would hide what it does
    lowest = min(named[0].held_out_error.items(), key=lambda item: item[1], default=None)
    if lowest is None or lowest[1] >= 1.0:
        return ""
    which = named[0].effect if len(named) > 1 else "this effect"
    return f" With {which} in the model, the error of {lowest[0]} on held-out data falls to {percent(lowest[1])} of its value before."


def summary(result: Findings) -> str:
    """The verdict in figures, for its card."""
    named, proxies = len(result.named), len(result.findings) - len(result.named)
    parts = [f"{describe.counted(named, 'effect')} named"] if named else []
    if wrong := len(describe.wrong_values(result)):
        parts.append(
            f"{describe.counted(wrong, 'value')} of the baseline {'is' if wrong == 1 else 'are'} wrong"
        )
    more = f"{proxies} more" if named else describe.counted(proxies, "effect")
    parts += (
        [f"{more} {'improves' if proxies == 1 else 'improve'} the prediction without being the cause"]
        if proxies
        else []
    )
    parts += ["a difference remains that no effect of the library explains"] if result.open_ended else []
    verdicts = Counter(c.verdict for c in result.candidates)
    parts += [f"{verdicts[v]} {v}" for v in ("ruled out", "could not be judged") if verdicts[v]]
    text = "; ".join(parts)
    return text[:1].upper() + text[1:]


def still_wrong(result: Findings) -> tuple[str, str]:
    """How much is still wrong, and where: outcome and story of its card."""
    beyond, several = inadequate(result.adequacy), len(result.recordings) > 1
    count = len(result.adequacy)
    if not beyond:
        return "Within the error budgets", f"{sentence(describe.remaining(result)[0])}"
    story = "; ".join(left(c, several=several) for c in beyond[:MOST_LEFT])
    more = f"; and {len(beyond) - MOST_LEFT} more channels" if len(beyond) > MOST_LEFT else ""
    return f"Beyond the error budget: {len(beyond)} of {describe.counted(count, 'channel')}", sentence(
        f"{story}{more}"
    )


def where_over(part: ErrorPart, *, several: bool) -> str:
    """'1200 to 1500 s', 'level above 8.2 V'; several: times name their recording."""
    if part.start_s is None or part.end_s is None:
        return part.regime
    return f"{f'{part.recording} ' if several else ''}{span(part.start_s, part.end_s)}"


def percent(share: float) -> str:
    """As `describe.share`, with spaces that do not break."""
    return describe.share(share).replace(" ", "\N{NO-BREAK SPACE}")


def kind_and_place(f: Finding) -> str:
    """'sensor of gyro', 'physics · steering servo'."""
    return f.place if f.kind in f.place else f"{f.kind} · {f.place}"


def clause(text: str) -> str:
    """A library's sentence within another: no full stop, no capital."""
    text = text.rstrip(".")
    # two capitals: an abbreviation such as IMU
    return text if text[:2].isupper() else text[:1].lower() + text[1:]


def sentence(text: str) -> str:
    """With a full stop, and a capital unless it begins with a channel's name."""
    first = text.partition(" ")[0]
    return f"{text if '_' in first else text[:1].upper() + text[1:]}".rstrip(".") + "."


def better(errors: Mapping[str, float]) -> str:
    """'gyro error × 0.18; others unchanged', best first; of many channels the best and the worst."""
    ranked = sorted(
        ((c, r) for c, r in errors.items() if abs(r - 1.0) >= describe.UNCHANGED), key=lambda item: item[1]
    )
    best, rest = ranked[:MOST_CHANNELS], ranked[MOST_CHANNELS:]
    parts = [f"{c} error {describe.error_ratio(r)}" for c, r in best]
    if rest:
        parts.append(
            f"{describe.counted(len(rest), 'more channel')} {describe.error_ratio(rest[0][1])} to {rest[-1][1]:.2f}"
        )
    same = len(errors) - len(ranked)
    return "; ".join([*parts, *(["others unchanged" if parts else "no channel changes"] if same else [])])


def where_text(where: Where) -> str:
    """Channels, time and regime of the evidence."""
    channels = ", ".join(f"{c} {percent(s)}" for c, s in where.channels.items() if s > SHARE_SHOWN)
    spans = "; ".join(
        f"{i.recording} {span(i.start_s, i.end_s)} ({percent(i.share)})" for i in where.intervals[:3]
    )
    time = (
        "throughout"
        if where.throughout or not spans
        else f"{'only' if where.temporary else 'mostly'} in {spans}"
    )
    regime = (
        f"; strongest where {where.regimes[0].text} ({where.regimes[0].density:.1f} times the average)"
        if where.regimes
        else ""
    )
    return f"{channels}; {time}{regime}"


def open_cards(found: OpenEquation) -> Iterator[str]:
    """Cards of the equation of known signals that the library does not contain, one for each place where its terms act."""
    for place in dict.fromkeys(t.place for t in found.terms):
        terms = [t for t in found.terms if t.place == place]
        facts = {
            f"c{i}": describe.estimate(
                Estimate(name=f"c{i}", value=t.coefficient, low=t.low, high=t.high, unit=t.unit)
            ).partition(" = ")[2]
            + (f"; fits as well: {', '.join(t.equally_good[:3])}" if t.equally_good else "")
            for i, t in enumerate(terms, 1)
        }
        facts["evidence, all terms"] = (
            f"{describe.evidence(found.sse_reduction)} (threshold {found.threshold:.0f}); on held-out data {describe.evidence(found.held_out_sse_reduction)}"
        )
        depends = [name for name in found.depends_on if any(_names(t.function, name) for t in terms)]
        about = f"Depends on {', '.join(depends)}." if depends else "A constant."
        yield (
            f'<article class="finding open"><h3>Outside the library<small>at {escape(place)}</small></h3>'
            f"<p>{escape(about)}</p>{added(place, [t.function for t in terms], found.depends_on)}{definitions(facts)}</article>"
        )


def _names(function: str, signal: str) -> bool:
    """Whether the text of a function names a signal, and not only a longer one."""
    # ² and ³ count as word characters, so that \b would not find x in x²
    return re.search(rf"(?<!\w){re.escape(signal)}(?![A-Za-z_\d])", function) is not None
