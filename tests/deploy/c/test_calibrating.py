"""A number that is written into the C ECU is the number that the calibration file's reader would have made of it, to the bit."""

import ctypes
import random
import struct

import numpy as np
import pytest

from ecu.measure.parameters import calibration_numbers
from tests.deploy.c.beside import put_beside, services_library
from tests.deploy.c.building import flat
from tests.deploy.c.test_ecu_in_c import moving
from tests.ecu.xcp.tool import CHANNEL, SECRET, Ecu
from tests.fuzz.services import xcp_commands

ADJUSTABLE = [number for number in calibration_numbers() if number.adjustable(detects_faults=False)]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return services_library(tmp_path_factory.mktemp("services"))


@pytest.fixture
def ecu(library):
    ecu = put_beside(Ecu(), library, secret=SECRET, xcp=CHANNEL)
    driven(ecu, 60)
    ecu.ask("ff00")
    ecu.unlock()
    return ecu


def driven(ecu, cycles):
    """A machine that turns, so that the numbers matter; the frames of both cores are compared in every cycle."""
    for _ in range(cycles):
        moving(ecu.machine, ecu.machine.tick)
        ecu.cycles(1)


def write(ecu, number, value):
    """Whether both cores take a value."""
    ecu.ask(struct.pack("<BHBI", 0xF6, 0, 0, number.address))
    return ecu.ask(b"\xf0\x04" + struct.pack("<f", value)) == b"\xff"


def numbers_in_c(ecu):
    """The machine's numbers, those of the limits and of the warnings, as the C works with them."""
    c, found = ecu.cycle.c, []
    calibration = ecu.cycle.calibration
    of_python = [
        flat(calibration.parameters), fields(calibration.limits), fields(calibration.warnings),
    ]  # fmt: skip
    for name, expected in zip(
        ("calibration_parameters", "calibration_limits", "warning_rules"), of_python, strict=True
    ):
        found.append(list((ctypes.c_double * len(expected)).in_dll(c, name)))
    return found, of_python


def fields(record):
    return [getattr(record, name) for name in type(record).__dataclass_fields__]


def test_the_program_is_compiled_with_the_files_numbers(ecu):
    found, expected = numbers_in_c(ecu)
    assert found == expected
    # written as they are, page and file agree to the bit
    ecu.ask(bytes((0xEB, 0x01, 0, 0)))
    driven(ecu, 1)
    found, expected = numbers_in_c(ecu)
    assert found == expected


@pytest.mark.parametrize("section", sorted({number.section for number in ADJUSTABLE}))
def test_every_number_acts_as_in_python(ecu, section):
    """Each is written near its value, with few and with all digits; what both refuse is refused alike."""
    rng, taken = random.Random(section), 0
    for number in [n for n in ADJUSTABLE if n.section == section]:
        (before,) = struct.unpack("<f", ecu.ask(struct.pack("<BBBBI", 0xF4, 4, 0, 0, number.address))[1:])
        near = before * rng.uniform(0.97, 1.03) or rng.uniform(number.quantity.low, number.quantity.high) / 50
        for value in (float(np.float32(f"{near:.3g}")), float(np.float32(near))):
            taken += write(ecu, number, value)
            driven(ecu, 1)
            found, expected = numbers_in_c(ecu)
            assert found == expected, f"{number.name} = {value!r}"
    assert taken > 0
    driven(ecu, 20)
    ecu.ask("fe")
    driven(ecu, 20)
    found, expected = numbers_in_c(ecu)
    assert found == expected


@pytest.mark.parametrize("seed", range(4))
def test_random_commands_with_the_key_change_both_alike(library, seed):
    rng = random.Random(seed)
    ecu = put_beside(Ecu(), library, secret=SECRET, xcp=CHANNEL)
    driven(ecu, 20)
    for k, _ in enumerate(xcp_commands(rng, 600, ecu.answers, SECRET)):
        if k % 3 == 0:
            driven(ecu, 1)
            found, expected = numbers_in_c(ecu)
            assert found == expected
