"""The timing verdicts of a real-time run, in the form that run.json holds."""

from dataclasses import dataclass

from hil.timing.deadlines import Judged
from hil.timing.measured import TaskVerdict
from hil.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Punctuality:
    """Verdicts on messages and tasks of one run."""

    frames: Verdict  # on all messages
    ticks: Verdict  # on all tasks and the reaction
    messages: tuple[Judged, ...]
    tasks: tuple[TaskVerdict, ...]
