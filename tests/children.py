"""Child processes as /proc shows them, proc(5)."""

from pathlib import Path


def command_lines(pid: int) -> dict[int, list[str]]:
    """The words of each child's command line by its process id; empty if the process has ended."""
    try:
        pids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return {int(p): Path(f"/proc/{p}/cmdline").read_text().split("\0") for p in pids}
    except (FileNotFoundError, ProcessLookupError):
        return {}


def alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be collected has ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
