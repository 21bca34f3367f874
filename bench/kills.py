"""kill -9 of every process of a run in real time: what is lost, how the run ends, and what is left of it.

    python -m bench.kills --out docs/results/kills.md

A listener of its own on each hub keeps every frame with the hub's stamp. What was on the bus at the moment of the kill and is
not in the log is lost; likewise the ticks of the plant whose truth is not in the run's folder.
"""

import argparse
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from bench.speed import commit
from bus.hub.client import HubTransport
from bus.transport import BusClosed, BusUnavailable
from dbc import loader_database
from dbc.recordings.reading import read_frames
from hil.ending import Ending
from hil.faults.record import read_faults
from hil.rundir import BUS, ECU_BUS, REFERENCE, RunDirectory

START_S, END_S = 120.0, 60.0
ALLOWED_S = 0.2
FAULTS = """
[[fault]]
kind = "drop"
message = "BodyRates"
probability = 0.2
"""
VICTIMS = {
    "plant": Ending.PEER_DIED,
    "ecu": Ending.PEER_DIED,
    "gateway": Ending.PEER_DIED,
    "recorder": Ending.PEER_DIED,
    "recorder's writer": Ending.PEER_DIED,
    "ecu-recorder": Ending.PEER_DIED,
    "ecu-recorder's writer": Ending.PEER_DIED,
    "plant's hub": Ending.HUB_LOST,
    "ecu's hub": Ending.HUB_LOST,
    "run itself": -signal.SIGKILL,
}
"""Processes of `run --realtime --gateway`, and the exit code that docs/howto/run-scenarios.md gives."""


class Listener:
    """Keeps the stamp and identifier of every frame of a hub."""

    def __init__(self, path: str) -> None:
        self.stamps: list[tuple[int, int]] = []
        self._transport = HubTransport(path, name="observer")
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        try:
            while True:
                self.stamps += [(frame.at_ns, frame.can_id) for frame in self._transport.drain(4096)]
                time.sleep(0.002)
        except (BusClosed, OSError):
            return

    def close(self) -> None:
        self._thread.join(END_S)
        self._transport.close()


@dataclass(frozen=True, slots=True)
class Kill:
    """What one kill came to."""

    code: int
    left: int
    """Processes that still ran afterwards."""
    lost_s: dict[str, float]
    """By file: how long before the kill the first thing on the bus was that the file lacks [s]; 0 if it lacks nothing."""
    problems: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)


def processes(supervisor: int) -> dict[str, int]:
    """Process ids of a run by the name of VICTIMS."""
    found = {"run itself": supervisor}
    for pid, words in _children(supervisor):
        if "loaderhil" not in words:
            continue
        command = words[words.index("loaderhil") + 1]
        if command == "record":
            name = "ecu-recorder" if any(word.endswith(ECU_BUS) for word in words) else "recorder"
            found |= {f"{name}'s writer": child for child, _ in _children(pid)}
        elif command == "hub":
            name = "ecu's hub" if "ecu" in Path(_hub(words)).name else "plant's hub"
        else:
            name = command
        found[name] = pid
    return found


def _children(pid: int) -> list[tuple[int, list[str]]]:
    """Children of all threads of a process, with their command lines."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        pids = [int(child) for task in tasks for child in (task / "children").read_text().split()]
        return [(child, Path(f"/proc/{child}/cmdline").read_text().split("\0")) for child in pids]
    except (FileNotFoundError, ProcessLookupError):
        return []


def _hub(words: list[str]) -> str:
    return words[words.index("--bus") + 1].removeprefix("hub:")


def hubs(supervisor: int) -> list[str]:
    """Paths of the sockets of the run's hubs, the plant's first."""
    found = [_hub(words) for _, words in _children(supervisor) if "hub" in words]
    return sorted(found, key=lambda path: "ecu" in Path(path).name)


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and is not yet waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def until(condition, patience_s: float, what: str):
    """The condition's first true value; RuntimeError after `patience_s`."""
    deadline = time.monotonic() + patience_s
    while not (value := condition()):
        if time.monotonic() > deadline:
            raise RuntimeError(f"{what}: not after {patience_s:.0f} s")
        time.sleep(0.02)
    return value


def kill(victim: str, folder: Path, wait_s: float) -> Kill:
    """Start a run, kill one of its processes `wait_s` after its first second, and look at what is left."""
    out, faults = folder / "run", folder / "faults.toml"
    faults.write_text(FAULTS)
    words = ["run", "loaded", "--realtime", "--gateway", "--inject", str(faults), "--out", str(out)]
    # its own group: a Ctrl-C for this script lets it end the run itself
    run = subprocess.Popen(
        [sys.executable, "-m", "loaderhil", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0,
    )  # fmt: skip
    pids: dict[str, int] = {}
    try:
        paths = until(lambda: len(found := hubs(run.pid)) == 2 and found, START_S, "hubs")
        # (a hub's socket exists a moment before the hub listens on it)
        listeners = [until(partial(_joined, path), START_S, f"the hub at {path}") for path in paths]
        # samples of the plant: the ECU's frames come before the plant is let go
        sample = loader_database().by_name["Articulation"].can_id
        until(
            lambda: sum(can_id == sample for _, can_id in listeners[0].stamps) > 10,
            START_S,
            "the plant's frames",
        )
        pids = until(lambda: len(found := processes(run.pid)) == len(VICTIMS) and found, START_S, "processes")
        time.sleep(1.0 + wait_s)
        os.kill(pids[victim], signal.SIGKILL)
        killed_ns = time.monotonic_ns()
        errors = run.communicate(timeout=END_S)[1]
        # after the kill of the run itself its children end by the kernel's signal, one by one
        deadline = time.monotonic() + 15.0
        while any(map(alive, pids.values())) and time.monotonic() < deadline:
            time.sleep(0.05)
        left = [pid for pid in pids.values() if alive(pid)]
        for listener in listeners:
            listener.close()
    finally:
        for pid in [run.pid, *pids.values()]:
            if (pid == run.pid and run.poll() is None) or (pid != run.pid and alive(pid)):
                os.kill(pid, signal.SIGKILL)
        run.wait(END_S)
    notes = errors.splitlines()
    return Kill(run.returncode, len(left), lost(out, listeners, killed_ns, notes), notes=notes)


def _joined(path: str) -> Listener | None:
    try:
        return Listener(path)
    except BusUnavailable:
        return None


def lost(out: Path, listeners: Iterable[Listener], killed_ns: int, notes: list[str]) -> dict[str, float]:
    """By file, how long before the kill the first thing was that the file lacks [s]; notes: gets which frames are missing."""
    found = {}
    for name, listener in zip((BUS, ECU_BUS), listeners, strict=True):
        heard = np.array([at_ns for at_ns, _ in listener.stamps if at_ns <= killed_ns]) // 1000
        logged = read_frames(out / name).time_ns // 1000
        missing = heard[~np.isin(heard, logged)]
        found[name] = _before(killed_ns, missing * 1000)
        if missing.size:
            before = [
                (killed_ns // 1000 - int(edge)) * 1e-6
                for edge in (missing[0], missing[-1], heard[0], logged[0])
            ]
            notes.append(
                f"{name} lacks {missing.size} of {heard.size} frames, {before[0]:.3f} to {before[1]:.3f} s before the kill; "
                f"the listener's first was {before[2]:.3f} s before it, the file's first {before[3]:.3f} s"
            )
        # the listener joins before the first frame and hears until the hub ends: then the log cannot hold anything else
        assert not np.any((logged > heard.max()) & (logged * 1000 < killed_ns)), (
            "the listener itself missed frames"
        )
    sample = loader_database().by_name["Articulation"].can_id
    ticks = np.array(
        [at_ns for at_ns, can_id in next(iter(listeners)).stamps if can_id == sample and at_ns <= killed_ns]
    )
    run = RunDirectory.read(out)
    rows = len(run.truth["time_s"]) if "time_s" in run.truth else 0
    # the plant sends one sample each tick, and writes its truth right after
    found["truth"] = _before(killed_ns, ticks[rows:])
    reference = read_frames(out / REFERENCE).time_ns
    found[REFERENCE] = max(float(killed_ns - reference.max()) * 1e-9, 0.0)
    found["faults.json"] = 0.0 if read_faults(out) else float("inf")
    return found


def _before(killed_ns: int, missing_ns: np.ndarray) -> float:
    return float(killed_ns - missing_ns.min()) * 1e-9 if missing_ns.size else 0.0


def page(results: dict[str, list[Kill]], seed: int, times: int) -> str:
    """The kills as Markdown. times: aimed at for each process."""
    command = re.sub(r" --out \S+", "", " ".join(["python -m bench.kills", *sys.argv[1:]]))
    name, clean = commit()
    lines = [
        "# kill -9 of every process",
        "",
        f"Made by `{command}` at commit {name}{'' if clean else ' with changes'}, seed {seed}, on a machine of {os.cpu_count()} cores; load {os.getloadavg()[1]:.1f} at the end.",
        "",
        "A run of `loaded` in real time over a gateway with a fault; one process is killed by SIGKILL at a random moment 1 to 2 s after the start. *Lost*: how long before the kill the",
        f"first frame (the first tick) was that is missing from the file, largest of all kills; at most {ALLOWED_S} s is promised. A listener of its own on each bus says what there was.",
        f"The aim is {times} kills of each process. The page is written after each round: if the run was ended early, it shows fewer.",
        f"For `{REFERENCE}`, which nothing but the plant hears: time from its last frame to the kill. The median over the kills is in brackets.",
        "",
        f"| killed | times | exit code | as documented | processes left | `{BUS}` [s] | `{ECU_BUS}` [s] | truth [s] | `{REFERENCE}` [s] | `faults.json` there |",
        "|---|---:|---|---|---:|---|---|---|---|---|",
    ]
    for victim, kills in results.items():
        if not kills:
            continue
        codes = sorted({kill.code for kill in kills})
        wanted = VICTIMS[victim]
        cells = []
        for name in (BUS, ECU_BUS, "truth", REFERENCE):
            values = [kill.lost_s[name] for kill in kills]
            cells.append(f"{max(values):.3f} ({statistics.median(values):.3f})")
        there = sum(kill.lost_s["faults.json"] == 0.0 for kill in kills)
        lines.append(
            f"| {victim} | {len(kills)} | {', '.join(str(int(code)) for code in codes)} | {'yes' if codes == [wanted] else f'no, {int(wanted)}'} "
            f"| {sum(kill.left for kill in kills)} | {' | '.join(cells)} | {there} of {len(kills)} |"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    """1 if anything promised does not hold."""
    parser = argparse.ArgumentParser(prog="python -m bench.kills", description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", choices=VICTIMS)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    results: dict[str, list[Kill]] = {victim: [] for victim in options.only or VICTIMS}
    broken = 0
    # one of each in turn: what the machine does meanwhile meets all of them
    for number in range(options.times):
        for victim, kills in results.items():
            with ExitStack() as stack:
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
                done = kill(victim, folder, rng.random())
            kills.append(done)
            late = {name: seconds for name, seconds in done.lost_s.items() if seconds > ALLOWED_S}
            wrong = done.code != VICTIMS[victim] or done.left or late
            broken += bool(wrong)
            values = " ".join(f"{name} {seconds:.3f}" for name, seconds in done.lost_s.items())
            print(f"{number + 1} {victim}: code {done.code}, {done.left} left, lost {values}", *(done.notes if wrong else []),
                  "WRONG" if wrong else "", file=sys.stderr, flush=True)  # fmt: skip
        if options.out:
            options.out.write_text(page(results, options.seed, options.times), encoding="utf-8")
    print(page(results, options.seed, options.times))
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
