"""The exported ECU in a clean Debian root: what is installed, what it takes, and when it sends its first frame.

    mmdebstrap --variant=minbase --include=systemd,systemd-sysv,iproute2 bookworm ROOT.tar
    mkdir ROOT && tar -C ROOT -xf ROOT.tar --exclude='./dev/*'
    scripts/with-vcan .venv/bin/python -m bench.debian_root ROOT --out docs/results/debian-root.md

ROOT is written into: the program, its unit, its settings. As root, on vcan0.
"""

import argparse
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final

from bus.address import open_transport
from deploy.c.project import write_project
from deploy.settings import ServiceSettings
from deploy.units import SETTINGS, service_files
from ecu.calibration import calibration_table, read_calibration

INTERFACE: Final = "vcan0"
PROGRAM: Final = "/opt/loader-ecu"
COMPILERS: Final = ("cc", "gcc", "clang", "tcc", "as", "ld", "python3", "perl")
"""What must not be needed. perl-base is part of every Debian; it is listed so that nobody wonders."""
WAIT_S: Final = 20.0


def main() -> int:
    """0: the ECU was installed and sent; 1: it did not."""
    options = _options()
    root: Path = options.root
    if not (root / "etc/debian_version").is_file():
        print(
            f"{root}: no Debian root; the head of bench/debian_root.py says how one is made", file=sys.stderr
        )
        return 2
    before = _size_kb(root)
    installed = installed_into(root)
    found = [name for name in COMPILERS if _in_root(root, "which", name).returncode == 0]
    verified = _in_root(root, "systemd-analyze", "verify", "loaderhil-ecu.service")
    # what `deploy units` prints as the commands for the target, as far as they need no running systemd
    for words in (("systemd-sysusers",), ("systemctl", "enable", "loaderhil-ecu")):
        done = _in_root(root, *words)
        if done.returncode:
            print(f"{' '.join(words)}: {done.stderr.strip()}", file=sys.stderr)
            return 1
    starts = [first_frame(root) for _ in range(options.times)]
    if None in starts:
        print("no frame came", file=sys.stderr)
        return 1
    delays = sorted(delay for delay, _ in filter(None, starts))
    memory = max(peak for _, peak in filter(None, starts))
    bytes_of = {name: (root / name).stat().st_size for name in installed}
    text = _page(root, before, bytes_of, found, verified.stderr.strip(), delays, memory)
    if options.out is None:
        print(text)
    else:
        options.out.write_text(text, encoding="utf-8")
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("root", type=Path, help="folder with the root")
    parser.add_argument("--times", type=int, default=20, help="starts")
    parser.add_argument("--out", type=Path, help="page to write; printed if it is left out")
    return parser.parse_args()


def installed_into(root: Path) -> list[str]:
    """Export, build and install as the how-to says; the files that are new, below the root."""
    with TemporaryDirectory() as folder:
        table = calibration_table("l60")
        write_project(Path(folder), read_calibration(table), table.values)
        subprocess.run(["make", "-s", "-C", folder, "linux/loader-ecu"], check=True)
        subprocess.run(["strip", f"{folder}/linux/loader-ecu"], check=True)
        program = (Path(folder) / "linux/loader-ecu").read_bytes()
        settings = Path(folder) / "ecu.toml"
        settings.write_text(
            f'[can]\ninterface = "{INTERFACE}"\nbit_rate_bit_s = 500000\n[ecu]\ncalibration = "l60"\ncore = "c"\n',
            encoding="utf-8",
        )
        files = {
            name: text.encode()
            for name, text in service_files(
                ServiceSettings.from_file(settings), "/usr/bin/loaderhil", ecu_program=PROGRAM
            ).items()
        }
        files |= {SETTINGS.lstrip("/"): settings.read_bytes(), PROGRAM.lstrip("/"): program}
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(content)
    (root / PROGRAM.lstrip("/")).chmod(0o755)
    return sorted(files)


def _in_root(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["chroot", root, *words], capture_output=True, text=True, check=False)


@contextmanager
def _started(root: Path) -> Iterator[subprocess.Popen[bytes]]:
    ecu = subprocess.Popen(["chroot", root, PROGRAM, INTERFACE])
    try:
        yield ecu
    finally:
        ecu.terminate()
        ecu.wait(20)


def first_frame(root: Path) -> tuple[float, int] | None:
    """Time from the call of the program to its first frame on the bus [s], and its largest memory [kB]; None: no frame came."""
    with open_transport(f"socketcan:{INTERFACE}", name="listener") as bus:
        started = time.monotonic()
        with _started(root) as ecu:
            while time.monotonic() - started < WAIT_S:
                select([bus.fileno()], [], [], 0.1)
                if bus.drain():
                    delay = time.monotonic() - started
                    time.sleep(0.5)
                    status = Path(f"/proc/{ecu.pid}/status").read_text(encoding="ascii")
                    peak = re.search(r"VmHWM:\s+(\d+) kB", status)
                    return delay, int(peak[1]) if peak else 0
    return None


def _size_kb(folder: Path) -> int:
    done = subprocess.run(["du", "-sk", folder], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[0])


def _page(
    root: Path,
    before_kb: int,
    installed: dict[str, int],
    compilers: list[str],
    complaints: str,
    delays: list[float],
    memory_kb: int,
) -> str:
    user_mode = "User Mode Linux" in Path("/proc/cpuinfo").read_text(encoding="ascii")
    version = (root / "etc/debian_version").read_text(encoding="ascii").strip()
    libraries = _in_root(root, "ldd", PROGRAM).stdout
    names = ", ".join(f"`{name}`" for name in re.findall(r"^\s*(\S+\.so\S*)", libraries, re.MULTILINE))
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    rows = "\n".join(f"| `/{name}` | {size} |" for name, size in installed.items())
    unlike = [name for name in compilers if name != "perl"]
    return f"""# The ECU in a clean Debian root

Made by `python -m bench.debian_root` at commit {commit.stdout.strip()}, on Linux {platform.release()}{" as a process (user-mode Linux, on a busy host)" if user_mode else ""}.
The root is Debian {version} by `mmdebstrap --variant=minbase --include=systemd,systemd-sysv,iproute2`, {before_kb / 1024:.0f} MB. Compilers and interpreters in it: {", ".join(unlike) or "none"} (beside `perl-base`, which every Debian has).

| installed | bytes |
|---|---:|
{rows}
| together | {sum(installed.values())} |

The program needs {names} of the root. `systemd-analyze verify` in the root says of the unit: {complaints or "nothing"}. `systemd-sysusers` made its user, `systemctl enable` its links; systemd itself was not booted.

| | median | least | most |
|---|---:|---:|---:|
| from the call of the program in the root to its first frame on the bus [s], {len(delays)} starts | {median(delays):.3f} | {delays[0]:.3f} | {delays[-1]:.3f} |

Memory of the process, most: {memory_kb / 1024:.1f} MB.
"""


if __name__ == "__main__":
    sys.exit(main())
