"""The open questions of the thesis: text, answer in one line, and the module that measures it. Imports no plant, so that `--help` is fast."""

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from bus.user_error import UserError


class Row(NamedTuple):
    """One line of the table: what the thesis reports, what the printed and the corrected estimator give."""

    what: str
    thesis: str
    printed: str
    corrected: str


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one question."""

    paragraphs: tuple[str, ...]  # Markdown
    rows: Sequence[Sequence[str]]  # of the table
    draw: Callable[[Path], None]  # draws the picture into a file
    headings: tuple[str, ...] = ("", "thesis", "printed", "corrected")


@dataclass(frozen=True, slots=True)
class Question:
    """One question."""

    name: str  # on the command line, and of its page
    title: str
    asked: str  # the question as the thesis leaves it open, with its section
    answer: str  # in one line
    module: str  # measures it

    @property
    def command(self) -> str:
        """The command that writes its page."""
        return f"loaderhil thesis {self.name}"

    def measured(self) -> Answer:
        """The measured answer; takes some seconds or minutes."""
        found: Answer = importlib.import_module(self.module).answer()
        return found


QUESTIONS = (
    Question(
        "front-offset",
        "The front-wheel offset that follows the articulation",
        "Against simulation the front wheels show an offset that changes its sign with the steering direction, the rear "
        "wheels none (4.5.3, 5.3.1). Why?",
        "The roll balance (80) lacks the arm of the rear pivot force about the centre of gravity; with it the offset is gone.",
        "studies.thesis.front_offset",
    ),
    Question(
        "late-roll-over",
        "The roll-over, seen late",
        "An abrupt articulation rolls the simulated machine over; the estimator names the right wheel, but less than a second after it has lifted (4.5.6, 5.3.4). Why?",
        "The acceleration of 2.5 has no centripetal part, so that only the roll angle of a machine already tipping shows it; with the centripetal part lift-off is foreseen.",
        "studies.thesis.late_roll_over",
    ),
    Question(
        "braking-spikes",
        "The missed spikes of hard braking",
        "In hard braking the measured loads swing in high spikes that the estimator misses (4.5.4, 4.5.5, 5.3.2). Why?",
        "The trunnion is taken to be a pin (two fifths too little), the machine rocks on its tyres, and the wheels' speed says nothing once they lock: measure the machine's acceleration and pitch rate.",
        "studies.thesis.braking_spikes",
    ),
    Question(
        "pile-entry",
        "Pile entry: which pressure",
        "In a pile the estimator cannot predict the loads; in one recording the lift pressure P_LP looks like them, in another P_TP (4.5.7, 5.3.5). Which should be used?",
        "Both: each is one moment of a force with two components, and which of them looks like the load depends on what arm and bucket do.",
        "studies.thesis.pile_entry",
    ),
    Question(
        "turning-torque",
        "The turning torque, too large by 12 and 15",
        "Against the torque that simulation has at the articulation joint, (94) is too large by 12 and 15, with an offset; why, and where should the "
        "turning torque be calculated (4.6, 5.4, 7.2)?",
        "(93) is no rotation and loses the front axle's lateral force, and the moment about the centre of gravity is not the torque at the joint: calculate both.",
        "studies.thesis.turning_torque",
    ),
    Question(
        "left-out",
        "What the print leaves out, found from recordings alone",
        "Could the mistakes have been found from recordings alone, without going through the equations?",
        "Yes: from one drive `loaderhil diagnose` names the pivot force's arm, the centripetal acceleration and three more, and none of the wrong corrections beside them.",
        "studies.thesis.left_out",
    ),
)


class NoSuchQuestion(UserError, ValueError):
    """There is no question of this name."""


def find(name: str) -> tuple[Question, ...]:
    """The question of that name, or all of them for 'all'."""
    if name == "all":
        return QUESTIONS
    found = tuple(question for question in QUESTIONS if question.name == name)
    if not found:
        names = ", ".join(question.name for question in QUESTIONS)
        raise NoSuchQuestion(f"no question '{name}'; there are {names}, and all")
    return found
