"""The shortest drive programme that determines what the drives at hand left open, of the bench's scenarios.

Each scenario is driven once in lockstep by the identified machine. The sensitivities of its replay, whitened by the noise of the recordings at
hand, give the information of another such drive. Information of drives adds, so every programme is judged without driving it.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from diagnosis.blind.hidden import NotHidden
from diagnosis.blind.hidden_run import run_with_effects
from discrepancy.estimation.effort import AS_IT_IS
from discrepancy.estimation.fit import fit, initial_uncertainty
from discrepancy.estimation.problem import Problem, Unusable
from discrepancy.models.loader import model as loader
from discrepancy.signals.recording import Recording
from hil.compose import Choice
from identify.machine.drives import DETERMINED, Identified
from plant.physics.surface import Surface
from plant.unit.scenario import list_scenarios

Array = NDArray[np.float64]
Progress = Callable[[str], None]

LONGEST: Final = (
    4  # drives of a programme: with ten scenarios a thousand programmes, all of which are compared
)
BATCH: Final = 256  # programmes whose matrices are inverted at once


@dataclass(frozen=True, slots=True)
class Drive:
    """A scenario, and the information of one drive of it."""

    name: str
    duration_s: float
    information: Array  # of the fitted parameters (k, k)


@dataclass(frozen=True, slots=True)
class Step:
    """One drive of a programme."""

    drive: Drive
    remaining: Mapping[str, float]  # posterior over prior standard deviation of each open parameter after it


@dataclass(frozen=True, slots=True)
class Programme:
    """Drives to add, and what they leave open."""

    target: float  # of the posterior over the prior standard deviation
    now: Mapping[str, float]  # of every parameter beyond the target
    steps: Sequence[Step]
    beyond: Sequence[str]  # parameters that no programme of LONGEST drives brings to the target
    left_out: Sequence[str]  # scenarios that could not be driven or used, with the reason

    @property
    def duration_s(self) -> float:
        return sum(step.drive.duration_s for step in self.steps)


def drives(found: Identified, machine_file: Path, progress: Progress) -> tuple[list[Drive], list[str]]:
    """The information of each of the bench's scenarios, driven by the machine of the file; and which were left out, with the reason."""
    usable: list[Drive] = []
    left_out: list[str] = []
    with tempfile.TemporaryDirectory(prefix="loaderhil-") as folder:
        for scenario in list_scenarios():
            # the replay knows level, dry ground and the machine's own effects only
            if scenario.surface != Surface() or scenario.changes.machine:
                left_out.append(f"{scenario.name}: its ground or its pile is not part of the replay")
                continue
            progress(f"driving {scenario.name}")
            run = Path(folder) / scenario.name
            try:
                run_with_effects(Choice(scenario=scenario.name).on(str(machine_file)), {}, run)
                gained = information(found, loader.load_run(run))
                usable.append(Drive(scenario.name, scenario.duration_s, gained))
            except (NotHidden, Unusable) as error:
                left_out.append(f"{scenario.name}: {error}")
    return usable, left_out


def information(found: Identified, recording: Recording) -> Array:
    """Of the fitted parameters (k, k) from one more recording at the identified values, without priors. Raises Unusable."""
    # a drive with instruments that the user does not have would promise too much
    known = {*found.problem.channels, *found.model.driving}
    kept = replace(recording, signals={name: s for name, s in recording.signals.items() if name in known})
    problem = Problem(found.coordinates.model(found.build([kept])), [kept])
    values = problem.start().with_shared({n: found.fit.values.shared[n] for n in found.fit.names})
    values = problem.warmed_up(values, values)
    unsure = initial_uncertainty(problem, values, problem.predict(values))
    columns = fit(problem, found.noise.on(problem, unsure), found.fit.names, values, effort=AS_IT_IS).columns
    return np.asarray(columns.T @ columns, float)


def shortest(
    found: Identified, candidates: Sequence[Drive], left_out: Sequence[str] = (), target: float = DETERMINED
) -> Programme:
    """The programme of least duration, of at most LONGEST drives, that brings every parameter to the target that any programme brings there.

    target: of the posterior over the prior standard deviation. Of equally long programmes the one with fewer drives is taken.
    """
    back, sds = found.coordinates.jacobian(found.names), np.array([found.priors[n][1] for n in found.names])
    # the disagreement of blocks of time stays as large as it is: more drives of the same model do not heal it
    wider = np.sqrt(found.inflation)

    def remaining(information: Array) -> Array:
        """Posterior over prior standard deviation (n, k), after drives of total information (n, k, k)."""
        C = np.linalg.inv(found.fit.information + information)
        variance = np.einsum("ij,njk,ik->ni", back, C, back)
        return np.asarray(np.sqrt(variance) * wider / sds, float)

    k = len(found.names)
    now = remaining(np.zeros((1, k, k)))[0]
    opened = np.flatnonzero(now > target)
    programmes = [
        combination
        for count in range(1, LONGEST + 1)
        for combination in combinations_with_replacement(candidates, count)
    ]
    after = [
        row
        for part in (programmes[i : i + BATCH] for i in range(0, len(programmes), BATCH))
        for row in remaining(np.array([sum((d.information for d in p), np.zeros((k, k))) for p in part]))
    ]
    best = np.min(after, axis=0, initial=np.inf) if after else np.full(k, np.inf)
    wanted = [i for i in opened if best[i] <= target]
    enough = [p for p, row in zip(programmes, after, strict=True) if all(row[i] <= target for i in wanted)]
    chosen = min(enough, key=lambda p: (sum(d.duration_s for d in p), len(p))) if wanted else ()
    steps, total = [], np.zeros((1, k, k))
    for drive in _most_informative_first(chosen, total, remaining, opened):
        total = total + drive.information
        row = remaining(total)[0]
        steps.append(Step(drive, {found.names[i]: float(row[i]) for i in opened}))
    return Programme(
        target,
        {found.names[i]: float(now[i]) for i in opened},
        steps,
        [found.names[i] for i in opened if best[i] > target],
        left_out,
    )


def _most_informative_first(
    chosen: Sequence[Drive], total: Array, remaining: Callable[[Array], Array], opened: NDArray[np.intp]
) -> list[Drive]:
    """The drives of a programme in the order in which each adds most to what is still open."""
    left, ordered = list(chosen), list[Drive]()
    while left:
        best = min(left, key=lambda d: float(np.sum(remaining(total + d.information)[0][opened])))
        left.remove(best)
        ordered.append(best)
        total = total + best.information
    return ordered
