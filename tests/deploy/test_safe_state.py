"""Whatever breaks, the machine is on its safe limits within the time that its equipment declares, or does not notice."""

import pytest

from bench.safe_state.events import (
    BESIDE,
    BROKEN,
    CUT,
    Outcome,
    c_ecu,
    can_be_measured,
    measured,
    python_ecu,
    unforced_of,
)
from bench.safe_state.judge import judged
from bench.safe_state.machine import Tick
from tests.deploy.c.building import compiler
from tests.deploy.c.test_targets import make

GOOD = Outcome(declared_s=0.05, late_s=0.02, safe_after_s=0.069)


@pytest.mark.parametrize(
    ("event", "outcome", "said"),
    [
        ("kill -9", Outcome(declared_s=0.05, late_s=0.02, safe_after_s=0.071), "safe limits after 0.071 s"),
        ("unplug", Outcome(declared_s=0.05, late_s=0.02), "safe limits after None s"),
        (
            "clock step",
            Outcome(declared_s=0.05, late_s=0.02, unforced_s=0.3),
            "the machine was on safe limits",
        ),
        ("full disk", Outcome(declared_s=0.05, late_s=0.0, exit_code=0), "exit code 0"),
        (
            "broken configuration",
            Outcome(declared_s=0.05, late_s=0.0, safe_after_s=0.05, exit_code=2, frames=1),
            "1 frames",
        ),
        (
            "broken configuration",
            Outcome(declared_s=0.05, late_s=0.0, safe_after_s=0.05, exit_code=0),
            "exit code 0",
        ),
    ],
)
def test_what_is_not_as_declared_is_said(event, outcome, said):
    (wrong,) = judged(event, outcome)
    assert said in wrong
    assert judged("kill -9", GOOD) == []


@pytest.mark.parametrize(
    ("late_ms", "ago_ms", "unforced"), [(10, 50, True), (29, 50, True), (31, 50, False), (500, 150, False), (500, 300, True)]
)  # fmt: skip
def test_safe_limits_just_after_a_late_tick_of_the_machine_answer_to_that(late_ms, ago_ms, unforced):
    """Ticks of 10 ms, one that is late, and safe limits some time after it; the event was before all of that."""
    times = [*range(0, 500, 10), 490 + late_ms]
    times += [times[-1] + 10 * k for k in range(1, 60)]
    begin = 490 + late_ms + ago_ms
    ticks = [Tick(at * 1_000_000, at >= begin, 3.5, 0.01) for at in times]
    assert unforced_of(ticks, 200_000_000) == (begin * 1_000_000 if unforced else None)
    assert unforced_of(ticks, (begin + 1) * 1_000_000) is None


@pytest.fixture(params=["python", "c"])
def ecu(request, tmp_path, ecu_sources):
    """The ECU in Python, and the exported Linux program."""
    if request.param == "python":
        return python_ecu(tmp_path)
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    return c_ecu(ecu_sources / "linux/loader-ecu")


@pytest.mark.socketcan
@pytest.mark.timeout(300)
class TestOnInterfacesOfTheKernel:
    @pytest.fixture(autouse=True)
    def possible(self):
        if not can_be_measured():
            pytest.skip("needs user-mode Linux, whose clock and disks are its own: scripts/uml-run")

    @pytest.mark.parametrize("event", [*CUT, *BROKEN])
    def test_the_machine_is_safe_in_the_declared_time(self, ecu, event):
        assert judged(event, measured(ecu, event)) == []

    @pytest.mark.parametrize("event", BESIDE[1:])
    def test_what_happens_beside_the_ecu_does_not_reach_the_machine(self, ecu, event):
        outcome = measured(ecu, event)
        # the ECU's own process may be held up too, which the machine's ticks do not show
        if outcome.late_s < outcome.declared_s / 2:
            assert judged(event, outcome) == []
        # an hour's age of the limits is the clock's and not the host's
        assert outcome.longest_gap_s < 2.0
        if event == "full disk":
            assert outcome.exit_code == 1
