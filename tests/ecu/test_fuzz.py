"""No frame may end the process: random bits and random plausible values, all signed; afterwards the ECU works again."""

import dataclasses
import math
import random

import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from ecu.findings import EstimatorFailed, FaultFound
from ecu.inputs import sources
from ecu.states import State
from tests.ecu.machine import MESSAGES, PERIOD_NS, STANDING, FakeMachine, decoded, play

CALIBRATION = load_calibration()
CODECS = [loader_database().by_name[name] for name in MESSAGES]
LIMITS = [
    {field.name: field.limit for field in source.fields if math.isfinite(field.limit)}
    for source in sources(CALIBRATION.inputs)
]
TICKS = 250


class Bits:
    """Contents of frames: random bits, all zero or all one, in a share of the frames."""

    def __init__(self, seed, share):
        self.random, self.share = random.Random(seed), share

    def values(self, machine):
        """Leave the machine as it is."""

    def content(self, data):
        """What a frame holds instead of `data`."""
        if self.random.random() >= self.share:
            return data
        kind = self.random.randrange(6)
        return bytes([(0x00, 0xFF)[kind]] * len(data)) if kind < 2 else self.random.randbytes(len(data))


class Values(Bits):
    """Plausible values: a message's signals now and then jump to zero, to a bound or in between, and stay there; messages fall silent."""

    def values(self, machine):
        """Change some of the machine's signals: all of a message alike, or each by itself."""
        for fields in LIMITS:
            if self.random.random() < self.share:
                alike = self.random.random() < 0.5
                place = self._place()
                for name, limit in fields.items():
                    machine.values[name] = (place if alike else self._place()) * limit
        if self.random.random() < self.share:
            machine.silent = set(self.random.sample(list(MESSAGES), self.random.randrange(3)))

    def _place(self):
        return self.random.choice((0.0, 0.0, -0.999, 0.999, 1e-6, self.random.uniform(-1.0, 1.0)))

    def content(self, data):
        """The frame as it is."""
        return data


def run(ecu, machine, fuzz, ticks):
    """Play frames that are signed after they were changed; every answer must be readable and finite."""
    protectors = {c.can_id: Protector(c) for c in CODECS if c.e2e_data_id is not None}
    for _ in range(ticks):
        now = machine.now_ns
        fuzz.values(machine)
        for frame in machine.frames():
            content = fuzz.content(bytes(frame.data))
            if frame.can_id in protectors:
                content = protectors[frame.can_id].protect(content)
            ecu.receive(Frame(frame.can_id, content, now), now)
        result = ecu.tick(now + PERIOD_NS // 2)
        assert all(map(math.isfinite, result.estimates))
        decoded(result.frames)


def test_a_sensor_that_comes_back_with_zeros_does_not_end_the_process():
    """No specific force at all weighs nothing, and would divide by zero, where the plausibility of its size is not asked for."""
    rules = dataclasses.replace(CALIBRATION.inputs, least_specific_force=0.0)
    ecu, machine = EcuCycle(dataclasses.replace(CALIBRATION, inputs=rules)), FakeMachine()
    play(ecu, machine, 30)
    machine.silent = {"BodyAcceleration"}
    play(ecu, machine, 20)
    machine.silent = set()
    machine.values["specific_force_z"] = 0.0
    (result,), findings = play(ecu, machine, 1)
    # The detection takes the sample for a fault of the sensor, an estimator fails and is contained, or the estimates stay numbers.
    contained = any(isinstance(f, EstimatorFailed | FaultFound) for f in findings)
    assert contained or all(map(math.isfinite, result.estimates))


@pytest.mark.parametrize("form", ["corrected", "printed"])
@pytest.mark.parametrize(
    ("kind", "share"), [(Bits, 1.0), (Bits, 0.1), (Values, 0.2), (Values, 0.05), (Values, 0.01)]
)
@pytest.mark.parametrize("seed", range(3))
def test_signed_frames_never_raise(kind, share, seed, form):
    ecu, machine = EcuCycle(CALIBRATION, form=form, detect_faults=True), FakeMachine()
    run(ecu, machine, kind(seed, share), TICKS)
    machine.values |= STANDING
    machine.silent = set()
    run(ecu, machine, Bits(seed, 0.0), TICKS)
    # wheels that were found to be exchanged stay so until the machine turns
    assert ecu.state in (State.RUNNING, State.DEGRADED)
