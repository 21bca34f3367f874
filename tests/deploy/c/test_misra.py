"""The exported C against the rules of MISRA C:2012 as cppcheck's addon checks them: docs/howto/export-c.md lists what is not kept."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

HOWTO = Path(__file__).resolve().parents[3] / "docs/howto/export-c.md"
WHOLE, BOARD = ("*.c", "services/*.c", "linux/*.c"), ("cortex_m4/*.c",)
"""Rules on what is used anywhere need a whole program."""
PLACES = ("ECU", "services/", "linux/", "cortex_m4/")
ROW = re.compile(r"^\| (ECU|services/|linux/|cortex_m4/) \| ([\d., ]+) \| (.+) \|$", re.MULTILINE)
FOUND = re.compile(r"^([\w./]+):\d+:\d+: .*\[misra-c2012-([\d.]+)\]$", re.MULTILINE)


def listed():
    """Place -> rules that the how-to lists."""
    found = {place: set() for place in PLACES}
    for place, rules, reason in ROW.findall(HOWTO.read_text(encoding="utf-8")):
        assert len(reason) > 10, f"{place} {rules}: a deviation has a reason"
        found[place] |= set(rules.split(", "))
    return found


def checked(folder, places, *, settable=False, detection=True):
    """(place, rule) of everything that the addon reports of these files.

    settable: as the program with services is compiled; detection: with the tests of sensors.
    """
    files = sorted(file.relative_to(folder).as_posix() for place in places for file in folder.glob(place))
    done = subprocess.run(
        ["cppcheck", "--addon=misra", "--enable=style", "--std=c99", "--quiet", "--inline-suppr", "-I.",
         "-DECU_DOUBLE", "-DECU_FINDINGS", "-UECU_PERTURBED", "-DECU_SETTABLE" if settable else "-UECU_SETTABLE",
         "-UECU_WITHOUT_DETECTION" if detection else "-DECU_WITHOUT_DETECTION", *files],
        cwd=folder, capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip
    assert "Bailing out" not in done.stdout + done.stderr
    return {
        (file.rpartition("/")[0] + "/" if "/" in file else "ECU", rule)
        for file, rule in FOUND.findall(done.stderr)
    }


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_deviation_is_listed_with_its_reason(ecu_sources):
    """A rule that is broken and not listed fails; so does a listed one that is kept by now."""
    if shutil.which("cppcheck") is None:
        pytest.skip("no cppcheck: Debian's package cppcheck")
    whole = checked(ecu_sources, WHOLE, settable=True)
    # alone: the program for the board uses half of the ECU's macros, and would report the others as unused
    board = {(place, rule) for place, rule in checked(ecu_sources, BOARD) if place == "cortex_m4/"}
    found = {place: {rule for where, rule in whole | board if where == place} for place in PLACES}
    assert found == listed()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_without_the_detection_no_other_rule_is_broken(ecu_sources):
    """What only the detection uses is left out with it, and not left behind unused."""
    if shutil.which("cppcheck") is None:
        pytest.skip("no cppcheck: Debian's package cppcheck")
    found = checked(ecu_sources, WHOLE, settable=True, detection=False)
    expected = listed()
    assert found, "the addon has looked"
    assert [(place, rule) for place, rule in sorted(found) if rule not in expected[place]] == []


@pytest.mark.slow
def test_the_addon_finds_what_breaks_a_rule(tmp_path):
    if shutil.which("cppcheck") is None:
        pytest.skip("no cppcheck: Debian's package cppcheck")
    (tmp_path / "bad.c").write_text(
        "int f(int a); int f(int a) { if (a > 0) { goto end; } end: return a; }\n"
    )
    assert ("ECU", "15.1") in checked(tmp_path, ("*.c",))
