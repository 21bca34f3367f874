"""Benchmark of the monitor: `python -m bench.bench_monitor [--frames N] [--rounds N]`.

CPU time per frame of each tool as a process that follows a bus: the frames of loader.dbc in bursts of 40
(--rate, by default 10 000 frames/s, more than two full 500 kbit/s buses), counted after a first second of them; 1/CPU is the rate that the
tool could sustain on a processor of its own. Lost: frames that were not printed. On the hub, and where vcan0 exists (scripts/with-vcan) on SocketCAN too, there beside candump.

Tools: ours raw, decoded lines, JSON, and the live table on a terminal; python-can's logger; cantools' monitor on a
terminal of the same size. And a log of the same frames in one go: ours against `cantools decode`.
Ours checks the end-to-end protection as well. Every tool runs in every round; medians and ranges are printed.
"""

import argparse
import os
import platform
import pty
import signal
import statistics
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import dbc
from bus.address import open_transport
from bus.frame import Frame
from bus.hub.client import hub_status
from bus.hub.server import Hub
from bus.socketcan.link import can_interfaces
from bus.ticks import Ticks
from dbc.protection import COUNTERS, Protector
from dbc.recordings.writer import candump_line

DBC = dbc.FOLDER / "loader.dbc"
BURST = 40
WARM_UP = 2_000
"""Frames before the count begins, and of the log whose cost is subtracted as that of starting up."""
LOG = 10
"""The log is that many times as long as what is sent on a bus."""
MONITOR = (sys.executable, "-m", "loaderhil", "monitor")
# For a tool to print what it has, and for buffers of pipes to drain.
SETTLE_S = 1.0


@dataclass(frozen=True)
class Tool:
    """A program to be measured."""

    name: str
    command: tuple[str, ...]
    terminal: bool = False  # draws on a terminal, instead of printing a line per frame


@dataclass(frozen=True)
class Place:
    """A bus on which tools are measured."""

    name: str
    address: str
    interface: str  # python-can's name of its kind
    channel: str  # python-can's name of the bus
    listening: Callable[[], int]  # number of programs that listen to it


def tools_on(place: Place) -> list[Tool]:
    """What is measured there, the reference of the ratio first."""
    can = ("-i", place.interface, "-c", place.channel)
    tools = [
        Tool("monitor --raw", (*MONITOR, "--raw", place.address)),
        Tool("monitor --lines", (*MONITOR, "--lines", place.address)),
        Tool("monitor --json", (*MONITOR, "--json", place.address)),
        Tool("python-can logger", (sys.executable, "-m", "can.logger", *can)),
        Tool("monitor --table", (*MONITOR, "--table", place.address), terminal=True),
        Tool(
            "cantools monitor",
            (sys.executable, "-m", "cantools", "monitor", *can, str(DBC)),
            terminal=True,
        ),
    ]
    candump = Tool("candump", ("candump", place.channel))
    return [candump, *tools] if place.interface == "socketcan" else tools


def traffic() -> list[Frame]:
    """Frames of every message of loader.dbc, protected, as often as the alive counter has values: they repeat well."""
    codecs = list(dbc.loader_database().by_name.values())
    protectors = {codec: Protector(codec) for codec in codecs if codec.e2e_data_id is not None}
    frames = []
    for _ in range(COUNTERS):
        for codec in codecs:
            data = bytes(codec.length)
            frames.append(
                Frame(codec.can_id, protectors[codec].protect(data) if codec in protectors else data)
            )
    return frames


def send(address: str, frames: int, rate: int) -> None:
    """That many frames, in bursts."""
    messages = traffic()
    with open_transport(address) as sender, Ticks(BURST * 1_000_000_000 // rate) as ticks:
        os.set_blocking(ticks.fileno(), True)
        for start in range(0, frames, BURST):
            ticks.expired()
            for number in range(start, min(start + BURST, frames)):
                sender.send(messages[number % len(messages)])


def read_away(descriptor: int, counts: list[int]) -> None:
    """Count line ends until the other side is closed."""
    try:
        while data := os.read(descriptor, 1 << 16):
            counts[0] += data.count(b"\n")
    except OSError:  # a terminal whose program has ended
        pass


def run(tool: Tool, place: Place, frames: int, rate: int) -> tuple[float, int]:
    """CPU time of a tool per frame [us], and how many frames it did not print."""
    ours, theirs = pty.openpty() if tool.terminal else os.pipe()
    if tool.terminal:
        # a table draws what fits: the same window for all
        termios.tcsetwinsize(theirs, (24, 80))
    before = place.listening()
    # curses takes the size from these where the terminal does not say it
    environment = {**os.environ, "TERM": "xterm", "LINES": "24", "COLUMNS": "80"}
    process = subprocess.Popen(
        tool.command,
        stdin=theirs if tool.terminal else subprocess.DEVNULL,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    os.close(theirs)
    counts = [0]
    # somebody has to read: a full pipe would hold the tool up, and measure us
    reader = threading.Thread(target=read_away, args=(ours, counts))
    reader.start()
    # frames that come before a tool listens would count as lost
    while place.listening() <= before:
        if process.poll() is not None:
            raise SystemExit(f"{' '.join(tool.command)} ended early, exit code {process.returncode}")
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    # imports and caches of a tool are paid before the count begins
    send(place.address, WARM_UP, rate)
    time.sleep(SETTLE_S)
    started_ns = cpu_ns(process.pid)
    send(place.address, frames, rate)
    time.sleep(SETTLE_S)
    used_ns = cpu_ns(process.pid) - started_ns
    process.send_signal(signal.SIGINT)
    if tool.name.startswith("cantools"):
        process.terminate()  # its curses take Ctrl-C for a key
    process.wait()
    reader.join()
    os.close(ours)
    return used_ns * 1e-3 / frames, 0 if tool.terminal else max(0, frames + WARM_UP - counts[0])


def cpu_ns(pid: int) -> int:
    """CPU time of a process so far, all its threads."""
    # in nanoseconds; /proc/PID/stat counts ticks of 10 ms, too coarse for a second of work
    return sum(int(task.read_text().split()[0]) for task in Path(f"/proc/{pid}/task").glob("*/schedstat"))


def follow(place: Place, frames: int, rounds: int, rate: int) -> None:
    """The table of the tools that follow a bus."""
    tools = tools_on(place)
    costs: dict[str, list[float]] = {tool.name: [] for tool in tools}
    lost: dict[str, int] = dict.fromkeys(costs, 0)
    for _ in range(rounds):
        for tool in tools:
            cost, missing = run(tool, place, frames, rate)
            costs[tool.name].append(cost)
            lost[tool.name] += missing
    print(f"\n| {place.name} | CPU us/frame | range | frames/s sustained | x monitor --raw | lost |")
    print("|---|---|---|---|---|---|")
    reference = statistics.median(costs["monitor --raw"])
    for name, values in costs.items():
        median = statistics.median(values)
        print(
            f"| {name} | {median:.1f} | {min(values):.1f}..{max(values):.1f} | {1e6 / median:,.0f} "
            f"| {median / reference:.2f} | {lost[name] if 'table' not in name and 'cantools' not in name else ''} |"
        )


def offline(folder: Path, frames: int, rounds: int) -> None:
    """The table of whole logs: CPU time, starting up subtracted."""
    messages = traffic()

    def log_of(count: int) -> Path:
        path = folder / f"{count}.log"
        path.write_text(
            "".join(
                candump_line(messages[n % len(messages)]._replace(at_ns=n * 400_000), "can0") + "\n"
                for n in range(count)
            )
        )
        return path

    logs = log_of(WARM_UP), log_of(frames + WARM_UP)
    arms = {
        "monitor --raw": (*MONITOR, "--raw", "{}"),
        "monitor --lines": (*MONITOR, "--lines", "{}"),
        "monitor --json": (*MONITOR, "--json", "{}"),
        "monitor --table": (*MONITOR, "--table", "{}"),
        "cantools decode": (sys.executable, "-m", "cantools", "decode", "--single-line", str(DBC)),
    }
    rates: dict[str, list[float]] = {name: [] for name in arms}
    for _ in range(rounds):
        for name, command in arms.items():
            short, long = (seconds(command, log) for log in logs)
            # the difference of two logs, so that the start of the interpreter does not count
            rates[name].append(frames / (long - short))
    print(f"\n| log of {frames} frames | frames/s | range | x cantools decode |")
    print("|---|---|---|---|")
    reference = statistics.median(rates["cantools decode"])
    for name, values in rates.items():
        median = statistics.median(values)
        print(
            f"| {name} | {median:,.0f} | {min(values):,.0f}..{max(values):,.0f} | {median / reference:.1f} |"
        )


def seconds(command: tuple[str, ...], log: Path) -> float:
    """CPU time of a tool over a log, given by name or on standard input."""
    with log.open("rb") as file:
        process = subprocess.Popen(
            [word.format(log) for word in command], stdin=file, stdout=subprocess.DEVNULL
        )
        # wait4 gives the times of this one child; getrusage sums those of all
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}: exit code {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def vcan_listeners() -> int:
    """Receivers of vcan0 in the kernel."""
    # the kernel's own list: python-can's tools have no other sign that they listen
    lists = Path("/proc/net/can").glob("rcvlist_*")
    return sum(line.split()[:1] == ["vcan0"] for each in lists for line in each.read_text().splitlines())


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--frames", type=int, default=20_000, help="frames per tool and round")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--rate", type=int, default=10_000, help="frames per second on a bus")
    arguments.add_argument(
        "--only", choices=("hub", "socketcan", "log"), help="by default all that can be had"
    )
    chosen = arguments.parse_args()
    print(
        f"{platform.machine()}, {os.cpu_count()} CPUs, Linux {platform.release()}, Python {platform.python_version()}, "
        f"python-can {version('python-can')}, cantools {version('cantools')}; "
        f"{chosen.rounds} rounds of {chosen.frames} frames"
    )
    with tempfile.TemporaryDirectory() as folder:
        if chosen.only in (None, "hub"):
            on_hub(str(Path(folder) / "hub"), chosen.frames, chosen.rounds, chosen.rate)
        if chosen.only in (None, "socketcan") and "vcan0" in can_interfaces():
            place = Place("SocketCAN", "socketcan:vcan0", "socketcan", "vcan0", vcan_listeners)
            follow(place, chosen.frames, chosen.rounds, chosen.rate)
        if chosen.only in (None, "log"):
            offline(Path(folder), LOG * chosen.frames, chosen.rounds)


def on_hub(path: str, frames: int, rounds: int, rate: int) -> None:
    """The tools that follow a bus, on a hub on a thread of this process."""
    with Hub(path) as hub:
        thread = threading.Thread(target=hub.run)
        thread.start()
        try:
            place = Place("hub", f"hub:{path}", "loaderhil", path, lambda: len(hub_status(path).clients))
            follow(place, frames, rounds, rate)
        finally:
            hub.stop()
            thread.join()


if __name__ == "__main__":
    main()
