"""The ECU in C as the ECU of the bench: the same run in lockstep; and as the ECU of another machine."""

import pytest

from deploy.c.project import write_project
from ecu.calibration import load_calibration
from hil.compose import Choice, lockstep, plant_unit
from hil.lockstep import Lockstep
from tests.deploy.c.building import STRICT, build
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.test_ecu_in_c import Pair, moving, play
from tests.ecu.machine import FakeMachine

CHOICE = Choice(scenario="abrupt_articulation", changes=("duration_s=6.0",))


@pytest.fixture(scope="module")
def python_run():
    bench = lockstep(CHOICE.load(), reference=False)
    return bench.run()


def test_a_closed_loop_with_c_is_the_run_with_python(ecu_double, python_run):
    """Plant and ECU answer one another: every frame of the bus is the same, limits that act included."""
    run = Lockstep(plant_unit(CHOICE.load()), BuiltEcu(ecu_double), reference=False).run()
    assert [(f.can_id, f.data) for f in run.bus] == [(f.can_id, f.data) for f in python_run.bus]


def test_single_precision_keeps_the_machine_on_its_wheels(ecu_single, python_run):
    """Choices may differ from those of Python; what they are for may not: the least load of a wheel stays within a twentieth."""
    run = Lockstep(plant_unit(CHOICE.load()), BuiltEcu(ecu_single), reference=False).run()
    least, expected = (min(min(moment.normal_force) for moment in each.truth) for each in (run, python_run))
    standing = max(python_run.truth[0].normal_force)
    assert expected > 0.0
    assert least == pytest.approx(expected, abs=0.05 * standing)


def test_another_machine_gives_the_same_answers(tmp_path):
    calibration = load_calibration("compact")
    write_project(tmp_path, calibration)
    library = build(
        sorted(tmp_path.glob("*.c")), tmp_path / "compact.so", *STRICT, "-shared", "-fPIC", "-DECU_DOUBLE"
    )
    pair, machine = Pair(library, calibration), FakeMachine()
    for k in range(150):
        moving(machine, k)
        play(pair, machine, 1)
