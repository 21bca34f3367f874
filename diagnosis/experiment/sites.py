"""Where manoeuvres are driven: the loader on the bench, any other model by itself."""

import json
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from bus.user_error import UserError
from diagnosis.apply.applying import baseline
from diagnosis.blind.hidden import NotHidden, Truth, concealed, staged
from diagnosis.blind.hidden_run import concealed_run, run_with_effects
from diagnosis.experiment.choosing import Manoeuvre
from diagnosis.models import Choice
from diagnosis.reading.csv_writer import csv_text
from diagnosis.reading.origin import Base
from diagnosis.sheet import Sheet, with_sheet
from discrepancy.decision.groups import Alternative
from discrepancy.decision.judgement import Judgement
from discrepancy.decision.prospect import Prospect, manoeuvre_recording
from discrepancy.model.description import Model
from discrepancy.models.loader.channels import REFERENCE as INSTRUMENTS
from hil.compose import Choice as Run
from hil.rundir import REFERENCE
from plant.unit.scenario import FOLDER, Scenario, load_scenario

MANOEUVRES: Final = Path(__file__).parent / "manoeuvres"
"""Scenarios made to distinguish effects, beside those of the bench."""
UNSUITABLE: Final = frozenset(
    {"standstill", "hard_braking", "pile_entry", "wheel_lock", "abrupt_articulation"}
)
"""Scenarios of the bench in which no wheel rolls freely for long enough, something is dug into, or a wheel is nearly lifted."""
MACHINE: Final = re.compile(r"^machine\s*=.*$", re.MULTILINE)


class NoManoeuvre(UserError, ValueError):
    """There is nothing that could be driven."""


class BenchSite:
    """The loader on the bench, through driver, sensors, CAN coding and ECU."""

    def __init__(self, choice: Choice, base: Base, sheet: Sheet, files: Sequence[str]) -> None:
        """files: scenarios of the user, by name or file; none: those of the bench that suit."""
        self._choice, self._base, self._sheet = choice, base, sheet
        loaded = [load_scenario(path) for path in (map(_found, files) if files else suitable())]
        self._scenarios: Mapping[str, Scenario] = {s.name: s for s in loaded}

    def manoeuvres(self) -> list[Manoeuvre]:
        """The scenarios."""
        return [
            Manoeuvre(name=s.name, sentence=s.sentence, duration_s=s.duration_s)
            for s in self._scenarios.values()
        ]

    def prospect(self, manoeuvre: Manoeuvre, judged: Judgement, likely: Alternative) -> Prospect:
        """The inputs of a run of the scenario, by a machine with the likely effect, and the channels that the present recordings have."""
        from discrepancy.models.loader import model as loader

        problem = judged.problem
        with tempfile.TemporaryDirectory(prefix="loaderhil-") as place:
            run = Path(place) / manoeuvre.name
            try:
                run_with_effects(self._run(manoeuvre.name), _effects(problem.model, likely), run)
            except NotHidden:
                # a machine that cannot have the effect drives nearly alike: the replay needs only what it measures
                shutil.rmtree(run, ignore_errors=True)
                run_with_effects(self._run(manoeuvre.name), {}, run)
            recording = loader.load_run(run)
        wanted = {*problem.channels, *problem.model.driving}
        recording = replace(recording, signals={n: s for n, s in recording.signals.items() if n in wanted})
        model = with_sheet(baseline(self._choice, self._base.given, [recording]), self._sheet)
        return Prospect(problem, judged.state.noise, recording, model=model)

    def drive(self, manoeuvre: Manoeuvre, judged: Judgement, truth: Truth, folder: Path) -> Path:
        """A run folder without the truth, and without test instruments where the present recordings have none."""
        concealed_run(self._run(manoeuvre.name), truth, folder)
        if not INSTRUMENTS & set(judged.problem.channels):
            (folder / REFERENCE).unlink(missing_ok=True)
        return folder

    def write(self, manoeuvre: Manoeuvre, folder: Path) -> Path:
        """A copy of the scenario, for the machine of the recordings."""
        scenario = self._scenarios[manoeuvre.name]
        text = scenario.path.read_text(encoding="utf-8")
        if self._base.given is not None:
            line = f"machine = {json.dumps(str(_absolute(self._base.given)))}"
            text = MACHINE.sub(lambda _: line, text, count=1)
        file = folder / f"{manoeuvre.name}.toml"
        file.write_text(text, encoding="utf-8")
        return file

    def _run(self, name: str) -> Run:
        run = Run(scenario=str(self._scenarios[name].path))
        return run if self._base.given is None else run.on(str(self._base.given))


class ModelSite:
    """A model that states manoeuvres of its own (`Model.manoeuvres`), simulated by itself with finer steps."""

    def __init__(self, model: Model) -> None:
        if not model.manoeuvres:
            raise NoManoeuvre(
                f"model {model.name} states no manoeuvres; give it some (`Model.manoeuvres`), or take the channels and sentences of the findings"
            )
        self._manoeuvres = {m.name: m for m in model.manoeuvres}

    def manoeuvres(self) -> list[Manoeuvre]:
        """Those of the model."""
        return [
            Manoeuvre(name=m.name, sentence=m.sentence, duration_s=m.duration_s)
            for m in self._manoeuvres.values()
        ]

    def prospect(self, manoeuvre: Manoeuvre, judged: Judgement, likely: Alternative) -> Prospect:
        """The model's own inputs over the manoeuvre."""
        del likely
        own = self._manoeuvres[manoeuvre.name]
        recording = manoeuvre_recording(judged.problem, own)
        return Prospect(judged.problem, judged.state.noise, recording, initial=own.initial)

    def drive(self, manoeuvre: Manoeuvre, judged: Judgement, truth: Truth, folder: Path) -> Path:
        """A table of the simulated manoeuvre. Raises NotHidden."""
        model, own = judged.problem.model, self._manoeuvres[manoeuvre.name]
        basis = staged(model, own, judged.problem.windows[0].constants)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{manoeuvre.name}.csv"
        file.write_text(csv_text(concealed(model, basis, truth, own.initial)), encoding="utf-8")
        return file

    def write(self, manoeuvre: Manoeuvre, folder: Path) -> None:
        """A model has no scenario files."""
        del manoeuvre, folder


def _found(name: str) -> Path | str:
    """The file of a scenario made for this, else the name or file as it is."""
    own = MANOEUVRES / f"{name}.toml"
    return own if own.is_file() else name


def suitable() -> list[Path]:
    """Scenarios that are offered where the user names none."""
    return sorted(
        path
        for folder in (FOLDER, MANOEUVRES)
        for path in folder.glob("*.toml")
        if path.stem not in UNSUITABLE
    )


def _effects(model: Model, likely: Alternative) -> dict[str, dict[str, float]]:
    """The fitted parameters of every effect of an explanation, by effect."""
    fitted = set(likely.fit.names)
    return {
        effect.name: {p.name: likely.fit.values.shared[p.name] for p in effect.parameters}
        for effect in model.effects
        if fitted & set(effect.names)
    }


def _absolute(machine: Path) -> Path:
    """A machine file by its whole path, since the scenario lies elsewhere; a name stays one."""
    return machine.resolve() if machine.suffix == ".toml" else machine
