"""Table of the standards' tests by name, and their output on a terminal."""

import importlib
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from configuration import ConfigurationError
from hil.check.tables import COLOUR
from hil.companions import EQUIPMENT, companion
from plant.sheets.changes import Changes
from plant.sheets.machine import load_machine
from plant.unit.equipment import load_equipment
from studies.standards.check import Candidate, Findings, Standard
from studies.standards.page import HEADINGS, row


def by_name(name: str) -> Standard:
    """The test of that name."""
    # on use: each test loads the plant, and the help page needs the names alone
    standard: Standard = importlib.import_module(f"studies.standards.{name}").STANDARD
    return standard


def candidate_of(machine: str, equipment: str | None, words: Sequence[str]) -> Candidate:
    """A machine with its equipment, both changed by `words` (KEY=VALUE). equipment None: the file beside the machine's, else its family's."""
    changes = Changes.of(words)
    if changes.scenario:
        key = ".".join(changes.scenario[0][0])
        raise ConfigurationError(
            f"--set {key}: keys here begin with machine. or equipment.; there is no scenario"
        )
    built = load_machine(machine, changes.machine)
    fitted = equipment or companion(Path(machine), EQUIPMENT) or built.family
    return Candidate(
        name=Path(machine).stem,
        machine=built,
        equipment=load_equipment(fitted, changes.equipment),
    )


def print_checks(console: Console, standard: Standard, findings: Findings) -> None:
    """Print the checks of one standard as a table."""
    table = Table(*HEADINGS, box=None, header_style="bold", title=standard.title, title_justify="left")
    for check in findings.checks:
        cells = [escape(cell) for cell in row(check, short=True)]
        if check.result is not None:
            cells[3] = f"[{COLOUR[check.result]}]{cells[3]}[/]"
        table.add_row(*cells)
    console.print(table)
    if any(check.bound and not check.bound.clause.verified for check in findings.checks):
        console.print("* unverified formula: from memory, not read in the standard")
    console.print()
