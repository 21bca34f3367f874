"""The table of gates: printed as it is, read by the modules that it names."""

import re
from pathlib import Path

import pytest

from diagnosis.handbook import with_gates
from discrepancy import gates
from discrepancy.selection.state import Settings
from tests.conftest import ROOT

PAGE = Path(ROOT / "docs/explanation/discrepancy.md")
NAMES = {value.name: name for name, value in vars(gates).items() if isinstance(value, gates.Gate)}
BY_SETTINGS = {"alpha": gates.FALSE_ALARM, "rival": gates.SAME_LIKELIHOOD, "gap_closed": gates.GAP_CLOSED}
BY_MODEL = {"negligible": gates.NEGLIGIBLE_SIZE, "least_explained": gates.LEAST_EXPLAINED}


def source(module: str) -> str:
    return (ROOT / "discrepancy" / module.replace(".", "/")).with_suffix(".py").read_text()


def test_the_explanation_prints_the_table_of_the_engine() -> None:
    text = PAGE.read_text()
    assert text == with_gates(text), "run scripts/findings-docs"


def test_every_step_of_the_explanation_names_modules_that_exist() -> None:
    steps = PAGE.read_text().partition("## How it decides")[2].partition("## Gates")[0]
    named = set(re.findall(r"`((?:signals|model|checks|estimation|selection|decision)\.\w+)`", steps))
    assert len(named) > 15
    for module in named:
        assert source(module)


@pytest.mark.parametrize("gate", gates.TABLE, ids=lambda gate: gate.name)
def test_every_gate_is_read_by_the_modules_it_names(gate: gates.Gate) -> None:
    """By its own name, or by the name under which settings and models hold it."""
    names = [f"gates.{NAMES[gate.name]}"]
    names += [f"settings.{name}" for name, of in BY_SETTINGS.items() if of.threshold == gate.threshold]
    names += [f"model.{name}" for name, of in BY_MODEL.items() if of is gate]
    names += (
        ["settings.held_out", "settings.least_held_out"] if "held_out" in NAMES[gate.name].lower() else []
    )
    names += ["settings.least_held_out"] if gate is gates.HELD_OUT_SHARE else []
    for module in gate.modules:
        assert any(name in source(module) for name in names), (module, names)


def test_settings_begin_with_the_thresholds_of_the_table() -> None:
    settings = Settings()
    for name, gate in BY_SETTINGS.items():
        assert getattr(settings, name) == gate.threshold
    assert (settings.held_out, settings.confirmed) == (
        gates.HELD_OUT_REDUCTION.threshold,
        gates.HELD_OUT_SHARE.threshold,
    )
