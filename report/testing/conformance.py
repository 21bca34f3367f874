"""The page about a conformance test: what is broken first, then every requirement with its evidence."""

from collections.abc import Sequence
from html import escape

from hil.verdict import Result
from report.kit.document import document
from report.run.parts import table, verdict_list
from testbench.conform.requirements import Kind, Requirement
from testbench.conform.results import summary

HEADINGS = ("message, input or node", "verdict", "evidence")


def page(node: str, source: str, dbc: str, found: Sequence[Requirement]) -> str:
    """The whole document. source: the bus or recording that was looked at."""
    broken = [each.verdict for each in found if each.result is Result.FAILED]
    unknown = [each.verdict for each in found if each.result is Result.INCONCLUSIVE]
    chapters = [
        ("broken", "Broken requirements", verdict_list(broken)),
        ("open", "Not judged, and why", verdict_list(unknown)),
        *((kind.name.lower(), kind.value.capitalize(), _chapter(kind, found)) for kind in Kind),
    ]
    return document(
        title=f"Conformance of {node}",
        kicker="loaderhil conform",
        head=f"<h1>Conformance of {escape(node)}</h1>"
        f'<p class="soft">{escape(source)}, against {escape(dbc)}. {escape(summary(found))}.</p>',
        chapters=chapters,
        footer="Written by loaderhil.",
    )


def _chapter(kind: Kind, found: Sequence[Requirement]) -> str:
    """All requirements of a kind; nothing where the DBC has none."""
    rows = [(each.subject, each.result.value, each.evidence) for each in found if each.kind is kind]
    return table(HEADINGS, rows) if rows else ""
