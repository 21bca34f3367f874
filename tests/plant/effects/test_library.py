"""The library as a whole: complete, consistent, documented, free of cost when off, open to the user's own."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from configuration import CheckedTable, ConfigurationError
from plant.effects import effects, find_effect
from plant.effects.dispatch import active_vector, compiled_hooks
from plant.effects.handbook import page, toml
from plant.effects.registry import python_hook
from plant.physics.parameters import parameter_vector
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.unit.sensor_parameters import SensorParameters

ROOT = Path(__file__).resolve().parents[3]
L60 = load_machine("l60")
NAMES = sorted(effects())


@pytest.mark.parametrize("name", NAMES)
def test_it_says_everything_a_user_needs(name):
    item = find_effect(name)
    assert item.name == name
    assert item.sentence.endswith(".")
    assert item.signature.endswith(".")
    assert item.equation
    assert item.acts_on
    assert item.excited_by
    assert item.source
    assert item.parameters
    for parameter in item.parameters:
        assert parameter.meaning
        assert parameter.unit
    for other in item.confusable:
        assert other.name in NAMES
        assert other.name != name


@pytest.mark.parametrize("name", NAMES)
def test_it_acts_somewhere(name):
    item = find_effect(name)
    vector, sensors = parameter_vector(L60, Surface(), 0.0), SensorParameters()
    prepared = parameter_vector(replace(L60, effects=(item.typical(),)), Surface(), 0.0)
    acts = bool(compiled_hooks(item)) or not np.array_equal(vector, prepared)
    change = python_hook(item, "sensors")
    if change is not None:
        given = replace(sensors, channels={"yaw_rate": replace(sensors.of("yaw_rate"), resolution=0.01)})
        changed = change(item.typical().named, given)
        acts |= changed.channels != given.channels or not np.array_equal(changed.inertial_axes, np.eye(3))
    assert acts


@pytest.mark.parametrize("name", NAMES)
def test_what_the_docs_show_switches_it_on(name, tmp_path):
    """The TOML that `loaderhil effects NAME` prints, appended to the machine's own file, is read as typical."""
    file = tmp_path / "machine.toml"
    base = (ROOT / "plant" / "machines" / "l60.toml").read_text(encoding="utf-8")
    file.write_text(base + "\n" + "\n".join(toml(find_effect(name))) + "\n", encoding="utf-8")
    (read,) = load_machine(file).effects
    typical = find_effect(name).typical()
    assert read.effect is typical.effect
    assert read.values == pytest.approx(typical.values, rel=1e-5)


def test_the_page_is_current():
    path = ROOT / "docs" / "reference" / "effects.md"
    assert path.read_text(encoding="utf-8") == page(effects()), "run scripts/effect-docs"


def test_none_on_means_the_plain_plant():
    """Nothing to call: the compiler sees None where the effects' switches would be."""
    assert active_vector(()) is None
    assert active_vector((find_effect("grade").typical(), find_effect("gyro_bias").typical())) is None
    assert active_vector((find_effect("pivot_friction").typical(),)) is not None


@pytest.mark.slow
def test_effects_of_no_size_leave_the_motion_as_it_was():
    """The same trajectory to rounding, through the plant that calls the effects' functions."""
    nothing = (
        find_effect("rolling_resistance").of(coefficient=0.0),
        find_effect("pivot_friction").of(torque_N_m=0.0),
        find_effect("aerodynamic_drag").of(drag_area_m2=0.0),
        find_effect("lug_excitation").of(amplitude_mm=0.0),
        find_effect("torque_error").of(front_percent=0.0, rear_percent=0.0),
    )
    plain, same = (Plant(replace(L60, effects=chosen), speed=3.0) for chosen in ((), nothing))
    commands = Commands(wheel_torque=(800.0,) * 4, articulation_rate=0.2, lift_rate=0.05)
    for plant in (plain, same):
        plant.advance(commands, 2.0)
    a, b = plain.truth(), same.truth()
    np.testing.assert_allclose(a.normal_force, b.normal_force, rtol=1e-9)
    assert a.speed == pytest.approx(b.speed, rel=1e-12)


def test_errors_name_file_key_unit_and_range():
    table = CheckedTable({"coefficient": 3.0}, file="m.toml", section="effects.rolling_resistance")
    with pytest.raises(ConfigurationError, match=r"m\.toml.*coefficient.*3.*0\.\.0\.3"):
        find_effect("rolling_resistance").read(table)
    table = CheckedTable({"coeficient": 0.03}, file="m.toml", section="effects.rolling_resistance")
    with pytest.raises(ConfigurationError, match=r"coeficient.*coefficient"):
        find_effect("rolling_resistance").read(table)
    with pytest.raises(ConfigurationError, match="no effect named 'rolling'"):
        find_effect("rolling")


def own_effect():
    """The file of docs/howto/add-an-effect.md."""
    text = (ROOT / "docs" / "howto" / "add-an-effect.md").read_text(encoding="utf-8")
    return re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]


def run_python(code, folder, **environment):
    """A process that has the effects of a folder beside the library's."""
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "LOADERHIL_EFFECTS": str(folder), "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_an_own_effect_is_there_in_the_second_process_as_in_the_first(tmp_path):
    """The first writes the module that calls the effects, the second finds it written."""
    (tmp_path / "headwind.py").write_text(own_effect(), encoding="utf-8")
    for _ in range(2):
        done = run_python("from plant.plant import Plant", tmp_path)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("EFFECT = 3\n", "defines no EFFECT"),
        ("import nowhere\n", "No module named 'nowhere'"),
        ("def (\n", "SyntaxError"),
    ],
)
def test_a_broken_file_is_named(tmp_path, text, words):
    (tmp_path / "broken.py").write_text(text, encoding="utf-8")
    done = run_python("from plant.effects import effects; effects()", tmp_path)
    assert done.returncode != 0
    last = done.stderr.strip().splitlines()[-1]
    assert "broken.py" in last
    assert words in last


def test_a_folder_that_is_missing_is_named(tmp_path):
    done = run_python("from plant.effects import effects; effects()", tmp_path / "none")
    assert "none: there is no such folder" in done.stderr
