"""`python -m tests.fuzz`: the long run over all readers and receivers, and its page of results.

Started again with the same commit it goes on where it ended, so it can be cut by --minutes or Ctrl-C at any time.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from tests.fuzz.frames import FRAMES, RECEIVERS
from tests.fuzz.long import State, block
from tests.fuzz.outcome import Outcome
from tests.fuzz.readers import READERS

BLOCK_CASES = dict.fromkeys(READERS, 5000) | dict.fromkeys(RECEIVERS, 1000)
"""Cases of a process: many beside the seconds of its start, few beside the time after which one would end the run."""


def main() -> int:
    """1 if a defect was found; writes the page after every round."""
    options = _options()
    commit = _commit()
    state = State.taken_up(options.state, commit)
    for name in READERS:
        state.cases.setdefault(name, options.first)
    until = time.monotonic() + 60 * options.minutes
    wanted = dict.fromkeys(READERS, options.files)
    wanted |= dict.fromkeys(RECEIVERS, -(-options.frames // FRAMES))
    wanted = {name: count for name, count in wanted.items() if not options.only or name in options.only}
    try:
        # in turn: a run that is ended early has carried out as many cases of each
        while left := [name for name, count in wanted.items() if state.cases.get(name, 0) < count]:
            for name in left:
                if time.monotonic() > until:
                    raise KeyboardInterrupt
                _one_block(state, name, wanted[name])
            _write(options, state)
    except KeyboardInterrupt:
        print("ended early; the same command goes on from here", file=sys.stderr)
    _write(options, state)
    return int(any(outcome.defects for outcome in state.done.values()))


def _one_block(state: State, name: str, wanted: int) -> None:
    first = state.cases.get(name, 0)
    count = min(BLOCK_CASES[name], wanted - first)
    begun = time.monotonic()
    outcome = block(name, first, count)
    state.add(name, outcome, first + count)
    took_s = time.monotonic() - begun
    print(
        f"{name}: cases {first} to {first + count - 1} of {wanted} in {took_s:.0f} s, {len(outcome.defects)} defects",
        *(f"  case {number}: {what}" for number, what in outcome.defects[:10]),
        sep="\n",
        file=sys.stderr,
        flush=True,
    )


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--files", type=int, default=100_000, help="mutated files for each reader")
    parser.add_argument(
        "--first",
        type=int,
        default=0,
        help="number of the first file: those before it were read at another commit",
    )
    parser.add_argument("--frames", type=int, default=10_000_000, help="frames for each receiver")
    parser.add_argument(
        "--minutes", type=float, default=float("inf"), help="end after the block at which this time is over"
    )
    parser.add_argument(
        "--only", action="append", choices=[*READERS, *RECEIVERS], help="one of them; may be repeated"
    )
    parser.add_argument("--state", type=Path, default=Path("out/fuzz.json"), help="what has been done so far")
    parser.add_argument("--report", type=Path, help="Markdown page to write")
    return parser.parse_args()


def _commit() -> str:
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout.strip()

    # what is not committed has no name under which somebody could repeat it
    return git("rev-parse", "--short=10", "HEAD") + (" with changes" if git("status", "--porcelain") else "")


def _write(options: argparse.Namespace, state: State) -> None:
    if options.report:
        options.report.write_text(page(state, options.first, options.files, options.frames), encoding="utf-8")


def page(state: State, first: int, files: int, frames: int) -> str:
    """The outcomes as Markdown, each beside its target; first: number of the first file."""
    lines = [
        "# Mutated files and frames",
        "",
        f"Made by `make fuzz` at commit {state.commit}. Every reader of foreign bytes on mutations of `tests/fuzz/corpus` and of the project's own files, and ECU, gateway",
        "and hub on random and mutated frames. Case *n* of a target always has the same bytes: its name and *n* are the seed.",
        "",
        "A file is *accepted* if it was read at least in part; else it has to end in one line. A defect is any other exception, more than 10 s for a case, a process that",
        "ends, or more than 1 GiB. Of the receivers: the ECU's estimates stay finite, and it works again within 2.5 s of good frames (every 20th case); the ECU in C answers and finds the same, and in INIT and FAULT no limit is above the safe one; the gateway's queues",
        "stay bounded and its counts add up while faults are injected; whatever one client of the hub sends, two others still reach one another.",
        *([f"Files are those from number {first} on."] if first else []),
        "",
        "| target | done | aimed at | accepted | slowest case [s] | largest growth of memory [MiB] | per second | defects |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name in (*READERS, *RECEIVERS):
        o = state.done.get(name, Outcome())
        aim = f"{frames} frames" if name in RECEIVERS else f"{files - first} files"
        share = f"{100 * o.accepted / o.units:.0f} %" if o.units else "–"
        rate = f"{o.units / o.took_s:.0f}" if o.took_s else "–"
        lines.append(
            f"| {name} | {o.units} | {aim} | {share} | {o.slowest_s:.2f} | {o.peak_mib:.0f} | {rate} | {len(o.defects)} |"
        )
    found = [(name, defect) for name, outcome in state.done.items() for defect in outcome.defects[:20]]
    if found:
        lines += [
            "",
            "## Defects",
            "",
            *(f"- {name}, case {number}: {what}" for name, (number, what) in found),
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
