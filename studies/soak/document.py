"""The page of a soak run in Markdown: the declared properties of the ECU, then every class of faults with its detections."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from hil.faults.table import KINDS
from studies.campaigns.batch import header
from studies.soak.soak import Happened, Soak
from studies.soak.watch import Mechanism, Witness

EXAMPLES = 3  # listed per class


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassOfFaults:
    """All faults of one kind."""

    kind: str
    injected: int
    struck: int  # faults that changed at least one frame
    detected: int  # of those
    by: Counter[tuple[Witness, Mechanism]]  # number of faults by who detected them, and how
    undetected: Sequence[str]  # labels of the faults


def classes(faults: Sequence[Happened]) -> list[ClassOfFaults]:
    """The faults by kind, in the order in which kinds are documented."""
    return [_class(kind, [f for f in faults if f.fault.kind == kind]) for kind in KINDS]


def _class(kind: str, faults: Sequence[Happened]) -> ClassOfFaults:
    struck = [f for f in faults if f.struck]
    return ClassOfFaults(
        kind=kind,
        injected=len(faults),
        struck=len(struck),
        detected=sum(bool(f.detected) for f in struck),
        by=Counter(each for f in struck for each in f.detected),
        undetected=[f.fault.label for f in struck if not f.detected],
    )


def page(found: Soak, command: str) -> str:
    """The whole page."""
    return (
        header(
            "Soak: an hour of random faults" if found.simulated_s >= 3600 else "Soak: random faults",
            command,
            f"seed {found.seed}",
        )
        + f"\n{_ran(found)}\n\n## What must hold\n\n{_promises(found)}\n"
        + _memory(found)
        + f"## What detected what\n\n{_classes(found)}\n## Not detected\n\n{_undetected(found)}"
    )


def _ran(found: Soak) -> str:
    struck = sum(f.struck for f in found.faults)
    return (
        f"{found.simulated_s:.0f} s of simulated time in {found.episodes} drives; {len(found.faults)} faults, one at a\n"
        f"time, {struck} of which changed at least one frame (a fault that shifts a signal by less than its\n"
        "resolution, freezes one that stands still or waits for frames that do not come changes none)."
    )


def _promises(found: Soak) -> str:
    share = {state: f"{state} {count}" for state, count in sorted(found.states.items())}
    rows = [
        (
            "states and transitions are the declared ones, never fault; limits inside the DBC's range",
            found.violations.count,
        ),
        ("between faults nobody reports anything", found.unexplained.count),
    ]
    table = "| promise | broken |\n|---|---|\n" + "".join(
        f"| {what} | {count or 'never'} |\n" for what, count in rows
    )
    unexplained = found.unexplained.lines[:EXAMPLES] if found.doubt else found.unexplained.lines
    lines = "".join(f"- {line}\n" for line in (*found.violations.lines, *unexplained))
    doubt = f"What was detected between faults decides nothing: {found.doubt}.\n\n" if found.doubt else ""
    ticks = f"Ticks of the ECU by state: {', '.join(share.values())}. Roll-overs: {found.rolled_over}.\n"
    return f"**{found.result.value}**\n\n{table}\n{doubt}{ticks}" + (f"\n{lines}" if lines else "")


def _memory(found: Soak) -> str:
    """The chapter on memory of the processes that lived long enough to be judged; '' in lockstep."""
    verdict = found.memory
    if verdict is None:
        return ""
    rows = "".join(
        f"| {life.process} | {life.seconds:.0f} | {_mib(life.start_bytes)} | {_mib(life.settled_bytes)} | "
        f"{_mib(life.end_bytes)} | {life.growth_bytes / 1024:.0f} |\n"
        for life in found.lives
        if life.growth_bytes is not None
    )
    head = "| process | s | start [MiB] | after a minute | end | most above that [KiB] |\n|---|---:|---:|---:|---:|---:|\n"
    return f"## Memory\n\n**{verdict.result.value}** {verdict.question}: {verdict.reason}.\n\n{head}{rows}\n"


def _mib(size: int | None) -> str:
    return "–" if size is None else f"{size / 2**20:.1f}"


def _classes(found: Soak) -> str:
    head = "| class | injected | struck | detected | by |\n|---|---:|---:|---:|---|\n"
    return head + "".join(
        f"| {c.kind} | {c.injected} | {c.struck} | {c.detected} | {_by(c)} |\n" for c in classes(found.faults)
    )


def _by(found: ClassOfFaults) -> str:
    named = [f"{who}: {mechanism} {count}" for (who, mechanism), count in sorted(found.by.items())]
    return ", ".join(named) or ("undetected" if found.struck else "–")


def _undetected(found: Soak) -> str:
    lines = []
    for each in classes(found.faults):
        if each.undetected:
            examples = "; ".join(dict.fromkeys(each.undetected[:EXAMPLES]))
            lines.append(f"- {each.kind}: {len(each.undetected)} of {each.struck}, such as {examples}\n")
    return "".join(lines) or "Every fault that struck was detected.\n"
