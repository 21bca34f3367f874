"""Switches of the exported C: each combination compiles without a warning, and a firmware without the detection has nothing of it."""

import itertools
import subprocess

import pytest

from tests.deploy.c.building import STRICT, build
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import RandomDrive
from tests.deploy.c.test_targets import make

SWITCHES = ("-DECU_DOUBLE", "-DECU_FINDINGS", "-DECU_SETTABLE", "-DECU_WITHOUT_DETECTION")
COMBINATIONS = [c for n in range(len(SWITCHES) + 1) for c in itertools.combinations(SWITCHES, n)]
WITHOUT = "OPTIONS=-DECU_WITHOUT_DETECTION"


@pytest.mark.parametrize("switches", COMBINATIONS, ids=lambda c: "+".join(c).replace("-DECU_", "").lower())
def test_every_combination_compiles_without_a_warning(ecu_sources, switches, tmp_path):
    """With the detection left out, what a program must not call any more is not declared."""
    files = [*sorted(ecu_sources.glob("*.c")), *sorted(ecu_sources.glob("library/cycle.c"))]
    if "-DECU_SETTABLE" in switches:
        files += sorted(ecu_sources.glob("services/*.c"))
    build(files, tmp_path / "all.o", *STRICT, f"-I{ecu_sources}", "-fsyntax-only", *switches)


def sent(library, seed, frames):
    ecu = BuiltEcu(library)
    calls = RandomDrive(CALIBRATION, seed).calls(frames)
    return [ecu.receive(f, now) if f is not None else ecu.tick(now).frames for f, now in calls]


def test_without_the_detection_it_is_the_ecu_with_the_detection_off(ecu_sources, ecu_double, tmp_path):
    library = build(
        sorted(ecu_sources.glob("*.c")), tmp_path / "without.so", *STRICT, "-shared", "-fPIC", "-DECU_DOUBLE",
        "-DECU_WITHOUT_DETECTION",
    )  # fmt: skip
    expected = sent(ecu_double, 3, 6_000)
    assert sent(library, 3, 6_000) == expected


@pytest.mark.processes
def test_a_firmware_without_the_detection_has_nothing_of_it(ecu_sources):
    """Nor the memory of its state, nor the trouble codes that only it makes."""
    sizes = []
    for options in ("OPTIONS=", WITHOUT):
        (ecu_sources / "cortex_m4/ecu.elf").unlink(missing_ok=True)
        make(ecu_sources, "cortex_m4/ecu.elf", "arm-none-eabi-gcc", options=options)
        elf = ecu_sources / "cortex_m4/ecu.elf"
        listed, sized = (
            subprocess.run([tool, elf], capture_output=True, text=True, check=True).stdout
            for tool in ("arm-none-eabi-nm", "arm-none-eabi-size")
        )
        assert ("detector_step" in listed) == (options != WITHOUT)
        text, data, bss = map(int, sized.splitlines()[-1].split()[:3])
        sizes.append((text + data, bss))
    (ecu_sources / "cortex_m4/ecu.elf").unlink()
    assert sizes[1][0] < sizes[0][0] - 10_000
    assert sizes[1][1] < sizes[0][1] - 3_000
