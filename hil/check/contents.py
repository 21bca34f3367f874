"""The verdict on the contents of a recording's frames, which `dbc.tally.contents` counts. Pure."""

from collections.abc import Iterable

from dbc.tally.contents import Contents
from hil.verdict import Result, Verdict

QUESTION = "every frame intact: length and CRC as the DBC says"


def judge_contents(found: Iterable[Contents]) -> Verdict:
    """Whether every frame had its length and its CRC; ranges and value tables are counted and decide nothing."""
    every = list(found)
    broken = [f"{each.name}: {', '.join(each.broken)}" for each in every if each.broken]
    if broken:
        more = f"; and {len(broken) - 3} more messages" if len(broken) > 3 else ""
        return Verdict(question=QUESTION, result=Result.FAILED, reason="; ".join(broken[:3]) + more)
    count = sum(each.frames for each in every)
    if not count:
        return Verdict(
            question=QUESTION, result=Result.INCONCLUSIVE, reason="no frame of any message of the DBC"
        )
    return Verdict(question=QUESTION, result=Result.PASSED, reason=f"{count} frames of {len(every)} messages")
