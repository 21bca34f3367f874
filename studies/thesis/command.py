"""`loaderhil thesis`: the open questions of the thesis, each answered by one command."""

from pathlib import Path
from typing import Annotated

import typer

from studies.thesis.questions import QUESTIONS, find


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(thesis)


def thesis(
    question: Annotated[str | None, typer.Argument(metavar="[QUESTION]", help="One of them, or all.")] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where page and picture go.")] = Path(
        "docs/thesis"
    ),
) -> None:
    """List what the thesis left open, or measure one answer: a page with numbers and a picture.

    Example: `loaderhil thesis turning-torque --out out/thesis`
    """
    if question is None:
        for item in QUESTIONS:
            print(f"{item.command}\n    {item.answer}")
        return
    questions = find(question)
    from studies.thesis.page import write_index, write_page

    for item in questions:
        print(write_page(item, out))
    if question == "all":
        print(write_index(QUESTIONS, out))
