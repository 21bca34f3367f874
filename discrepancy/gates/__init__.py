"""The table of gates: every test that a channel, an effect, a group, an equation or a verdict has to pass, in the order of application.

For readers who want to know why an effect was named or not. The engine reads its thresholds from here and
docs/explanation/discrepancy.md prints the table, so that neither can differ from the other. The folder lies beside those of the
engine's steps and imports none of them: screening, checks and decisions all read it.

Limits of pure numerics (iterations, rounding, caches) stay where they are used. Limits of cost are in
discrepancy.estimation.effort and discrepancy.selection.state; those that keep an effect from being tried appear in the reasons.
"""

# ruff: noqa: F403, I001
# A gate joins the table when its module is imported: the order of these lines is the order of the table.
from discrepancy.gates.gate import TABLE as TABLE
from discrepancy.gates.gate import Gate as Gate
from discrepancy.gates.gate import markdown
from discrepancy.gates.before_fits import *
from discrepancy.gates.fits import *
from discrepancy.gates.names import *
from discrepancy.gates.verdicts import *


def table() -> str:
    """The table in Markdown, as docs/explanation/discrepancy.md prints it."""
    return markdown(TABLE)
