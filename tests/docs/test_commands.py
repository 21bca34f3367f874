"""Commands that pages print are commands of the command line, with options that exist; links lead somewhere."""

import re
from typing import Any

import pytest
import typer

from loaderhil.cli import app
from tests.docs.pages import ROOT, commands, pages

PAGES = pages()
NAMES = [str(p.relative_to(ROOT)) for p in PAGES]
UsageError = typer.BadParameter.__mro__[1]  # of the parser that typer brings, which has no public name


def parse(words: tuple[str, ...]) -> None:
    """Raise UsageError unless these words can be parsed; values, such as files, are not looked at."""
    command: Any = typer.main.get_command(app)
    context, rest = command.context_class(command, info_name="loaderhil"), list(words)
    while hasattr(command, "resolve_command") and rest and not rest[0].startswith("-"):
        if context.parent is not None and command.get_command(context, rest[0]) is None:
            return  # a group that is a command as well: `loaderhil effects NAME`
        name, command, rest = command.resolve_command(context, rest)
        context = command.context_class(command, info_name=name, parent=context)
    _, left, _ = command.make_parser(context).parse_args(rest)
    if left:
        raise UsageError(f"more words than arguments: {left}")


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_printed_commands_have_commands_and_options_that_exist(page):
    wrong = []
    for command in commands(page.read_text(encoding="utf-8")):
        try:
            parse(command.words)
        except UsageError as error:
            wrong.append(f"{page.name}:{command.line}: loaderhil {' '.join(command.words)}: {error.message}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "words",
    [("rn", "loaded"), ("run", "loaded", "--realtim"), ("check", "a.blf", "b.blf"), ("run", "--seed")],
)
def test_a_wrong_command_is_seen(words):
    with pytest.raises(UsageError):
        parse(words)


def test_commands_are_found_in_every_form_that_pages_use():
    page = (
        "    loaderhil run a \\\n      --seed 3     # why\n$ loaderhil hub &\n`loaderhil check X`\n"
        "    candump -L can0 | loaderhil monitor -\nloaderhil is no command here... loaderhil gone\n    loaderhil run ...\n"
    )
    words = [c.words for c in commands(page)]
    assert words == [("run", "a", "--seed", "3"), ("hub",), ("check", "X"), ("monitor", "-")]


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", h.replace("`", "").lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_to_pages_and_headings_that_exist(page):
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if target.startswith(("http", "mailto")):
            continue
        file, _, anchor = target.partition("#")
        goal = (page.parent / file).resolve() if file else page
        if not goal.exists() or (anchor and anchor not in anchors(goal.read_text(encoding="utf-8"))):
            broken.append(target)
    assert not broken
