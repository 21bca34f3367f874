"""Runs a user's expectations against every mutant in lockstep, and says which of them nobody noticed."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bus.user_error import UserError
from configuration import CheckedTable
from dbc import loader_database
from hil import rundir
from hil.compose import Choice, calibration_of, plant_unit
from hil.ecu_side import ecu_cycle
from hil.faults.injector import Injector
from hil.faults.record import injected, write_faults
from hil.faults.restartable import RestartableEcu, RestartablePlant, acting_on
from hil.faults.table import faults_of, read_fault
from hil.faults.wire import FaultyWire
from hil.lockstep import EcuSide, Lockstep
from hil.rundir import RunDirectory
from hil.runs import write_recording
from hil.verdict import Result, Verdict
from testbench.conclusion import expectations_for, judge_expectations
from testbench.verify.errors import BentEcu
from testbench.verify.mutants import Mutant


class VerifyError(UserError, ValueError):
    """The tests cannot be verified: there are none, or they fail without any mutant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One mutant. noticed: questions of the expectations that failed; open: of those that could no longer be judged."""

    mutant: Mutant
    noticed: tuple[str, ...]
    open: tuple[str, ...]

    @property
    def result(self) -> Result:
        """PASSED: noticed; INCONCLUSIVE: not judged, which `run` reports with exit code 5; FAILED: nobody noticed."""
        if self.noticed:
            return Result.PASSED
        return Result.INCONCLUSIVE if self.open else Result.FAILED

    @property
    def verdict(self) -> Verdict:
        """As question and reason."""
        if self.noticed:
            more = f" and {len(self.noticed) - 1} more" if len(self.noticed) > 1 else ""
            reason = f"noticed by: {self.noticed[0]}{more}"
        else:
            reason = f"not judged any more: {self.open[0]}" if self.open else "nobody noticed"
        return Verdict(question=f"{self.mutant.kind}: {self.mutant.name}", result=self.result, reason=reason)


def verify(
    choice: Choice, chosen: Sequence[Mutant], notify: Callable[[Mutant, int], None]
) -> Iterator[Outcome]:
    """One outcome per mutant, in their order. notify: gets each mutant before it is run, with its number.

    VerifyError when the choice has no expectation, or one fails without any mutant.
    """
    if not expectations_for(choice):
        raise VerifyError(f"{choice.expect or choice.scenario}: has no [[expect]] table to verify")
    # what fails without a mutant would fail with each of them, and seem to notice all
    before = {v.question: v.result for v in _judged(choice, None)}
    broken = [question for question, result in before.items() if result is Result.FAILED]
    if broken:
        raise VerifyError(f"{broken[0]}: fails without any mutant; repair that first")
    for number, mutant in enumerate(chosen):
        notify(mutant, number)
        after = _judged(replace(choice, changes=(*choice.changes, *mutant.changes)), mutant)
        yield Outcome(
            mutant=mutant,
            noticed=tuple(v.question for v in after if v.result is Result.FAILED),
            open=tuple(
                v.question
                for v in after
                # what was open before says nothing of the mutant
                if v.result is Result.INCONCLUSIVE and before.get(v.question) is Result.PASSED
            ),
        )


def _judged(choice: Choice, mutant: Mutant | None) -> tuple[Verdict, ...]:
    """The verdicts on a choice's expectations, from a lockstep run with this mutant."""
    with tempfile.TemporaryDirectory(prefix="loaderhil-verify-") as folder:
        run = Path(folder) / "run"
        _drive(choice, mutant, run)
        return judge_expectations(RunDirectory.read(run), choice)


def _drive(choice: Choice, mutant: Mutant | None, out: Path) -> None:
    """A run directory of the scenario with its own faults and the mutant's."""
    scenario, database = choice.load(), loader_database()
    calibration = calibration_of(scenario, choice.calibration)
    faults = [
        fault
        for file in choice.fault_files()
        for fault in faults_of(file, database, alone=file == choice.inject)
    ]
    if mutant is not None and mutant.fault is not None:
        faults.append(read_fault(CheckedTable(mutant.fault, file="verify", section="fault"), database))

    # a `kill` starts the ECU anew: the error has to be in the new one as well
    def fresh() -> EcuSide:
        cycle = ecu_cycle(form=choice.form, limits=choice.limits, calibration=calibration, core=choice.core)
        error = mutant.error if mutant is not None else None
        return BentEcu(cycle, error, database) if error is not None else cycle

    injector = Injector(database, faults, seed=scenario.seed)
    injector.start(0)
    plant, ecu = RestartablePlant(plant_unit(scenario)), RestartableEcu(fresh)
    # no reference instruments: no expectation reads them, and they cost time in every mutant
    bench = Lockstep(plant, ecu, wire=FaultyWire(injector, acting_on(plant, ecu)), reference=False)
    recording = bench.run()
    injector.finish(bench.now_ns)
    record = choice.record(scenario, "lockstep")
    rundir.begin(out, record)
    if lost := write_recording(out, recording):
        raise VerifyError("; ".join(lost))
    write_faults(out, injected(injector.events))
    duration_s = float(recording.truth[-1].time_s) if recording.truth else 0.0
    rundir.write_record(out, replace(record, outcome="finished", duration_s=duration_s))
