"""Writes one Markdown page per question, with its picture, and the index."""

from collections.abc import Sequence
from pathlib import Path

from studies.campaigns.batch import header, markdown_table
from studies.thesis.drive import SEED
from studies.thesis.questions import Question

INDEX = "README.md"

INTRODUCTION = """
J. Spencer and B. Wullt, *Tire and force distribution modeling and validation for wheel loader applications* (LTU, 2017), leave these questions
open. Each is answered by a drive of the plant like the thesis' own, in which the estimators as printed show what the thesis reports and the
corrected ones do not. The thesis prints neither the mass split nor the centre of gravity of its machine, so every
answer is given for a range of them. Numbers in parentheses are its equations and sections, E-numbers the errata in
[Estimators: printed and corrected](../explanation/estimators.md).

"""


def write_page(question: Question, out: Path) -> Path:
    """Run the drives, write picture and page; returns the path of the page."""
    out.mkdir(
        parents=True, exist_ok=True
    )  # first, so that an unwritable folder is reported before the long computation
    answer = question.measured()
    # beside the page under its name, so that the page links it without a path
    picture = f"{question.name}.svg"
    answer.draw(out / picture)
    parts = (
        header(question.title, question.command, f"seed {SEED}"),
        f"**Question.** {question.asked}\n",
        f"**Answer.** {question.answer}\n",
        f"![{question.title}]({picture})\n",
        *(f"{paragraph}\n" for paragraph in answer.paragraphs),
        "## Reported and measured\n",
        markdown_table(answer.headings, answer.rows),
    )
    page = out / f"{question.name}.md"
    page.write_text("\n".join(parts), encoding="utf-8")
    return page


def write_index(questions: Sequence[Question], out: Path) -> Path:
    """The index of all pages."""
    lines = [f"- [{item.title}]({item.name}.md): {item.answer} `{item.command}`" for item in questions]
    index = out / INDEX
    index.write_text(
        "# What the thesis left open\n" + INTRODUCTION + "\n".join(lines) + "\n", encoding="utf-8"
    )
    return index
