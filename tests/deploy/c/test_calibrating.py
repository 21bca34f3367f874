"""A number that is written into the C ECU is the number that the calibration file's reader would have made of it, to the bit."""

import ctypes
import random
import struct

import numpy as np
import pytest

from dbc import loader_database
from deploy.c.detection_tables import machine_detection
from deploy.c.rules_tables import machine_rules
from ecu import reasons
from ecu.measure.parameters import calibration_numbers
from tests.deploy.c.beside import put_beside, services_library
from tests.deploy.c.building import flat
from tests.deploy.c.test_ecu_in_c import moving
from tests.ecu.xcp.tool import CHANNEL, SECRET, Ecu
from tests.fuzz.services import xcp_commands

ADJUSTABLE = [number for number in calibration_numbers() if number.adjustable]


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


class AlarmTimes(ctypes.Structure):
    """AlarmTimes of ecu_types.h."""

    _fields_ = [("on_delay_ns", ctypes.c_int64), ("level", ctypes.c_uint8)]


def numbers_in_c(ecu):
    """The machine's numbers and what follows from them, limits, warnings, times of alarms, rules of the detection: as the C works with them, and as Python does."""
    c, calibration = ecu.cycle.c, ecu.cycle.calibration
    times = reasons.times(calibration.alarms)
    alarms = [times[name] for name in (*reasons.REASONS, *(state.name for state in reasons.STATES))]
    of_python = {
        "calibration_parameters": flat(calibration.parameters),
        "calibration_limits": fields(calibration.limits),
        "warning_rules": fields(calibration.warnings),
        "machine_rules": list(machine_rules(calibration.parameters).values()),
        **machine_detection(calibration, loader_database()),
    }
    found = {name: list((ctypes.c_double * len(of_python[name])).in_dll(c, name)) for name in of_python}
    of_python["alarm_holds"] = [alarms[0].least_on_ns, alarms[0].off_delay_ns]
    found["alarm_holds"] = list((ctypes.c_int64 * 2).in_dll(c, "alarm_holds"))
    of_python["alarm_times"] = [each.on_delay_ns for each in alarms]
    found["alarm_times"] = [each.on_delay_ns for each in (AlarmTimes * len(alarms)).in_dll(c, "alarm_times")]
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


@pytest.mark.parametrize("value", [5.9495075e-20, 3.3e-14, 2.7e-30, 1e-45, 0.3, 1e-12])
def test_a_number_too_small_for_powers_of_ten_is_the_same_in_both(ecu, value):
    number = next(n for n in ADJUSTABLE if n.key == "rear_torque_kn_m")
    assert write(ecu, number, value)
    driven(ecu, 1)
    found, expected = numbers_in_c(ecu)
    assert found == expected
