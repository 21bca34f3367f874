"""`loaderhil thesis`: lists the questions, writes a page that says how to make it again, and the index."""

import dataclasses
import sys
import types

import pytest
import typer
from typer.testing import CliRunner

from studies.campaigns.batch import commit
from studies.thesis import command
from studies.thesis.drive import SEED
from studies.thesis.page import write_index, write_page
from studies.thesis.questions import QUESTIONS, Answer, NoSuchQuestion, Question, Row, find

NAMES = [question.name for question in QUESTIONS]


def run(*arguments):
    app = typer.Typer()
    command.register(app)
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def known():
    """A question whose answer is known."""
    answer = Answer(("It is so.",), (Row("a", "b", "c", "d"),), lambda file: file.write_text("<svg/>"))
    sys.modules["a_known_answer"] = types.ModuleType("a_known_answer")
    sys.modules["a_known_answer"].answer = lambda: answer
    yield Question("known", "A title", "What?", "That.", "a_known_answer")
    del sys.modules["a_known_answer"]


def test_alone_it_lists_every_question_with_its_command_and_answer():
    printed = run().output
    for question in QUESTIONS:
        assert f"loaderhil thesis {question.name}\n    {question.answer}" in printed


def test_listing_the_questions_loads_no_plant():
    import subprocess

    code = "import sys, studies.thesis.command; sys.exit(any(m.startswith(('plant', 'numba', 'matplotlib')) for m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_wrong_name_is_refused_with_the_right_ones():
    problem = run("frontoffset").exception
    assert isinstance(problem, NoSuchQuestion)
    assert all(name in str(problem) for name in (*NAMES, "all"))


def test_all_are_all_and_names_are_unique():
    assert find("all") == QUESTIONS
    assert len(set(NAMES)) == len(NAMES)
    assert [find(name)[0].name for name in NAMES] == NAMES


def test_a_page_says_what_made_it_and_shows_answer_table_and_picture(known, tmp_path):
    page = write_page(known, tmp_path / "new")
    text = page.read_text()
    for part in (
        "# A title",
        "`loaderhil thesis known`",
        f"seed {SEED}",
        commit(),
        "What?",
        "That.",
        "It is so.",
        "](known.svg)",
    ):
        assert part in text
    assert "| a | b | c | d |" in text
    assert (tmp_path / "new" / "known.svg").read_text() == "<svg/>"


def test_the_index_leads_to_every_page(known, tmp_path):
    text = write_index([known, dataclasses.replace(known, name="other")], tmp_path).read_text()
    assert "[A title](known.md): That. `loaderhil thesis known`" in text
    assert "(other.md)" in text


def test_the_committed_index_and_pages_are_those_of_the_questions():
    from studies.campaigns.batch import ROOT

    folder = ROOT / "docs" / "thesis"
    index = (folder / "README.md").read_text()
    for question in QUESTIONS:
        assert f"]({question.name}.md): {question.answer} `{question.command}`" in index
        page = (folder / f"{question.name}.md").read_text()
        assert question.asked in page
        assert question.answer in page
        assert (folder / f"{question.name}.svg").read_text().startswith("<?xml")
