"""Writes verdicts as JSON and as JUnit XML, for scripts and build servers."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from bus.user_error import UserError
from hil.ending import Ending
from hil.verdict import Result, Verdict


class ResultsError(UserError, OSError):
    """The file of results cannot be written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One question with its answer."""

    name: str
    result: Result
    reason: str
    decides: bool = True  # whether INCONCLUSIVE counts against the whole: an error in JUnit, else skipped
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, verdict: Verdict, *, decides: bool = True) -> "Case":
        """A verdict as a case."""
        return cls(name=verdict.question, result=verdict.result, reason=verdict.reason, decides=decides)


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """The cases of one run, recording or campaign."""

    name: str
    cases: tuple[Case, ...]
    time_s: float = 0.0  # simulated or recorded time [s], as JUnit's time
    remarks: tuple[str, ...] = ()


def ending_of(results: Iterable[Result]) -> Ending:
    """The ending that verdicts of equal weight make: FAILED if one failed, else INCONCLUSIVE if one could not be reached."""
    # failed before inconclusive: a known failure is worth more than an open question
    found = set(results)
    if Result.FAILED in found:
        return Ending.FAILED
    return Ending.INCONCLUSIVE if Result.INCONCLUSIVE in found else Ending.PASSED


def as_json(command: str, ending: Ending, suites: Sequence[Suite], **more: Any) -> str:
    """The whole as one JSON object: the command, its exit code, and each suite with its cases; more: further keys of the command."""
    # no time stamp and no host name: equal runs give equal files
    content = {
        "command": command,
        "exit_code": int(ending),
        "suites": [
            {
                "name": suite.name,
                "duration_s": suite.time_s,
                "remarks": list(suite.remarks),
                "cases": [
                    {"question": case.name, "result": case.result.value, "reason": case.reason}
                    for case in suite.cases
                ],
            }
            for suite in suites
        ],
        **more,
    }
    return json.dumps(content, indent=2, ensure_ascii=False)


def as_junit(command: str, suites: Sequence[Suite]) -> bytes:
    """JUnit XML. FAILED is a failure; INCONCLUSIVE an error where it counts against the whole, else skipped."""
    root = ET.Element("testsuites", name=f"loaderhil {command}")
    for suite in suites:
        element = ET.SubElement(root, "testsuite", _counts(suite))
        for case in suite.cases:
            each = ET.SubElement(
                element, "testcase", classname=f"{command}.{suite.name}", name=_clean(case.name), time="0"
            )
            if case.result is Result.FAILED:
                ET.SubElement(each, "failure", message=_clean(case.reason), type="FAILED")
            elif case.result is Result.INCONCLUSIVE:
                kind = {"error": {"type": "INCONCLUSIVE"}, "skipped": {}}[
                    "error" if case.decides else "skipped"
                ]
                ET.SubElement(
                    each, "error" if case.decides else "skipped", {"message": _clean(case.reason), **kind}
                )
            else:
                ET.SubElement(each, "system-out").text = _clean(case.reason)
        if suite.remarks:
            ET.SubElement(element, "system-out").text = _clean("\n".join(suite.remarks))
    ET.indent(root)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="utf-8") + b"\n"


def _counts(suite: Suite) -> dict[str, str]:
    open_cases = [case for case in suite.cases if case.result is Result.INCONCLUSIVE]
    return {
        "name": _clean(suite.name),
        "tests": str(len(suite.cases)),
        "failures": str(sum(case.result is Result.FAILED for case in suite.cases)),
        "errors": str(sum(case.decides for case in open_cases)),
        "skipped": str(sum(not case.decides for case in open_cases)),
        "time": f"{suite.time_s:.3f}",
    }


def _clean(text: str) -> str:
    """Without the control characters that XML 1.0 cannot hold."""
    return "".join(char for char in text if char in "\t\n\r" or ord(char) >= 0x20)


def write_junit(file: Path, command: str, suites: Sequence[Suite]) -> None:
    """The suites into `file`; ResultsError if it cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(as_junit(command, suites))
    except OSError as error:
        raise ResultsError(f"--junit {file}: cannot be written: {error.strerror or error}") from error
