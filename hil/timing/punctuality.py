"""How a real-time run kept its times: every message on every bus, every task; as run.json holds it."""

from dataclasses import dataclass

from hil.timing.deadlines import Judged
from hil.timing.measured import TaskVerdict
from hil.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Punctuality:
    """frames: the verdict on all messages; ticks: that on all tasks and the reaction."""

    frames: Verdict
    ticks: Verdict
    messages: tuple[Judged, ...]
    tasks: tuple[TaskVerdict, ...]
