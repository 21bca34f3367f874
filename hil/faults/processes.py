"""Faults that kill a process of the bench, and start it again."""

import random
from dataclasses import dataclass

from configuration import CheckedTable
from hil.faults.passage import Action, Effect, Side
from hil.faults.traffic import read_side


@dataclass(frozen=True, slots=True)
class Kill:
    """A process is killed as the fault begins; where the fault has an end, a new one is started then."""

    process: Side

    def effect(self, generator: random.Random) -> Effect:
        # frames are not touched: those of the killed process stop coming by themselves
        effect = Effect()
        effect.begins_with = (Action("kill", self.process),)
        effect.ends_with = (Action("restart", self.process),)
        return effect


def read_kill(table: CheckedTable) -> Kill:
    """kind = "kill"."""
    return Kill(read_side(table, "process"))
