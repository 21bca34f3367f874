"""The detection of sensor faults in C: the same findings, replaced samples and trouble codes as in Python, to the bit."""

import dataclasses
from collections import Counter
from pathlib import Path

import pytest

import studies.soak as soak
from deploy.c.both import BOTH
from deploy.c.core import C
from ecu.codes import Mode
from ecu.core import PYTHON
from ecu.findings import FaultFound
from hil.compose import Choice, lockstep
from hil.ending import Ending
from hil.runs import run_lockstep
from tests.deploy.c.building import compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import RandomDrive
from tests.deploy.c.test_core import SCENARIOS

DRIVE = str(Path(soak.__file__).with_name("detection_matrix.toml"))
"""Loaded, 11 to 14 km/h, slalom."""
DRIFTED = (Mode.DRIFTED_HIGH, Mode.DRIFTED_LOW)
SIGNALS = {
    "Articulation": ("ArticulationAngle", None, 8.0),
    "WheelSpeedsFront": ("Left", "Right", 3.0),
    "BodyRates": ("YawRate", "RollRate", 10.0),
    "BodyAcceleration": ("Lateral", "Longitudinal", 4.0),
    "SlopeSensor": ("PitchAngle", "RollAngle", 6.0),
    "TiltPressure": ("TiltCylinderPressure", None, 4000.0),
    "WheelTorquesRear": ("Right", "Left", 15.0),
}
"""Message -> one of its signals, another one, and an offset that is no motion of the machine, in the DBC's units."""
KINDS = {
    "offset": 'signal = "{signal}"\noffset = {by}',
    "freeze": 'signal = "{signal}"',
    "spike": 'signal = "{signal}"\nheight = {by}\nevery = 12',
    "swap": 'signals = ["{signal}", "{other}"]',
}


@pytest.fixture(autouse=True)
def _compiler():
    compiler()


def modes_of(findings):
    return Counter(finding.mode for finding in findings if isinstance(finding, FaultFound))


def random_drive(ecu, seed, frames, found):
    """Ends with an error where the cores differ."""
    for frame, now in RandomDrive(CALIBRATION, seed).calls(frames):
        if frame is not None:
            ecu.receive(frame, now)
        else:
            found += ecu.tick(now).findings


def test_random_drives_with_wild_signals_have_the_same_faults():
    """Frames and findings are compared at every call; what was found covers each way to find a fault."""
    found = []
    for seed in (0, 1):
        random_drive(BOTH.ecu(CALIBRATION, detect_faults=True), seed, 15_000, found)
    modes = modes_of(found)
    assert {Mode.NOT_RESPONDING, Mode.RATE_OF_CHANGE, Mode.ROOT_CAUSE_NOT_KNOWN} <= modes.keys()
    assert modes.keys() & set(DRIFTED)


@pytest.mark.parametrize(("seed", "frames"), [(13, 5_000), (57, 8_000)])
def test_in_single_precision_it_decides_in_the_same_cycle(ecu_single, seed, frames):
    """Drives in which the steering lines' pressures cross: a cycle later the other one is the lower one, and is taken for faulty.

    Times that ended by the rounding of their sum left the ECU running where Python's was degraded, for up to 5 s.
    """
    python, c = PYTHON.ecu(CALIBRATION, detect_faults=True), BuiltEcu(ecu_single, detect_faults=True)
    found, theirs, ours = [], [], []
    for frame, now in RandomDrive(CALIBRATION, seed).calls(frames):
        if frame is not None:
            python.receive(frame, now)
            c.receive(frame, now)
        else:
            found += python.tick(now).findings
            c.tick(now)
            theirs.append(python.state)
            ours.append(c.state)
    assert modes_of(found)
    assert ours == theirs


def test_off_it_finds_no_fault():
    ecu, found = C.ecu(CALIBRATION), []
    random_drive(ecu, 0, 6_000, found)
    assert found
    assert not modes_of(found)


def test_a_machine_that_is_set_after_loading_has_its_own_thresholds():
    """Two machines of one library: the tolerances and the noise of the sensors are set with the rest."""
    rules = CALIBRATION.detection
    sensors = {name: dataclasses.replace(s, noise=5.0 * s.noise) for name, s in rules.sensors.items()}
    other = dataclasses.replace(CALIBRATION, detection=dataclasses.replace(rules, sensors=sensors))
    ordinary, deaf = [], []
    random_drive(C.ecu(CALIBRATION, detect_faults=True), 0, 6_000, ordinary)
    random_drive(BOTH.ecu(other, detect_faults=True), 0, 6_000, deaf)
    assert modes_of(ordinary) != modes_of(deaf)


def faults(kind):
    """A fault of this kind in each of SIGNALS in turn; what no signal of its message is coded like cannot be exchanged."""
    tables = [
        f'[[fault]]\nkind = "{kind}"\nmessage = "{message}"\nat_s = {2.0 + 2.0 * k}\nfor_s = 0.8\n'
        + KINDS[kind].format(signal=signal, other=other, by=by)
        for k, (message, (signal, other, by)) in enumerate(SIGNALS.items())
        if kind != "swap" or other is not None
    ]
    return "\n\n".join(tables)


@pytest.mark.parametrize("kind", KINDS)
def test_faults_of_a_kind_in_one_sensor_after_the_other(kind, tmp_path):
    """Any difference of frames or findings ends the run; at least three of the sensors are found, by the detection or by the checks of single signals."""
    file = tmp_path / "faults.toml"
    file.write_text(faults(kind))
    done = run_lockstep(
        Choice(scenario=DRIVE, changes=("duration_s=17",), inject=file, core=BOTH, detect_faults=True),
        tmp_path / "run",
    )
    assert done.ending is Ending.PASSED, done.record.reason
    counts = done.record.statistics
    assert counts.get("ecu_finding_FaultFound", 0) + counts.get("ecu_finding_Implausible", 0) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_scenario_is_the_same_run(scenario):
    chosen = Choice(scenario=scenario).load()
    ours, theirs = (lockstep(chosen, core=core, detect_faults=True).run() for core in (C, PYTHON))
    assert ours.bus == theirs.bus
    assert ours.ecu_findings == theirs.ecu_findings
