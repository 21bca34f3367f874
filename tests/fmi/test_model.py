"""A compiled FMU as the model of a diagnosis: equal to the same equations in Python; what is wrong with it is said in one line."""

import re
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from bus.user_error import UserError
from configuration import ConfigurationError
from discrepancy.examine import examine
from discrepancy.model import Model, Recording, Window, signal
from discrepancy.model.failure import BadModel
from discrepancy.selection.state import Settings
from fmi.archive import FOLDER, FmuError, Unpacked
from fmi.instance import StepError
from fmi.model import read_model
from tests.conftest import ROOT
from tests.fmi.fmus import TANK, Source, Var, built

PAGE = (ROOT / "docs/howto/write-a-model.md").read_text("utf-8")
COMPANION = """
window_s = 20.0
[inputs.inflow]
port = 0.05
[outputs.level]
bias = 0.05
faults = ["scale", "delay", "lag"]
[parameters.area]
typical = 0.05
prior_sd = 0.02
[initial.start_level]
guess = "level"
typical = 0.1
[effects.leak]
typical = 0.02
"""
FAILS = replace(TANK, advance="if (v[AREA] < 0.8) return 1;" + TANK.advance)


@pytest.fixture(scope="module")
def python() -> Model:
    """The tank of the how-to."""
    names: dict[str, object] = {}
    exec(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0], names)
    found = names["model"]
    assert isinstance(found, Model)
    return found


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A leak of 0.05 1/s, integrated at a fifth of the model's step by another method."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 115.0, 0.1)
    pumped = rng.uniform(0.0, 0.2, 40)
    inflow = pumped[(t / 3.0 + 1e-9).astype(int)]
    level, truth = 1.0, []
    for u in inflow:
        truth.append(level)
        level = u / 0.05 + (level - u / 0.05) * np.exp(-0.05 * 0.1)  # exact for a held inflow
    noisy = np.array(truth) + rng.normal(0.0, 0.01, t.size)
    return Recording(
        "today", {"inflow": signal(t, inflow, "m^3/s", held=True), "level": signal(t, noisy, "m")}
    )


def fmu(folder: Path, source: Source = TANK, fmi: int = 2, companion: str = COMPANION, defines=()) -> Path:
    file = built(source, folder, fmi, defines)
    if companion:
        file.with_suffix(".toml").write_text(companion, encoding="utf-8")
    return file


def window(level: float = 1.0) -> Window:
    t = np.arange(0.0, 5.0, 0.1)
    return Window(
        recording="r",
        start_s=0.0,
        end_s=4.9,
        time_s=t,
        step_s=0.1,
        known={"inflow": 0.1 + 0.1 * np.sin(t), "level": np.full(t.size, level)},
        constants={},
    )


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_fmus_of_these_tests_are_valid(tmp_path, fmi):
    assert validate_fmu(str(fmu(tmp_path, fmi=fmi))) == []


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_simulates_as_the_same_equations_in_python(tmp_path, python, fmi):
    model = read_model(fmu(tmp_path, fmi=fmi)).build(())
    values = {"area": 1.3, "leak": 0.07, "start_level": 0.8}
    extra = {"inflow": np.linspace(0.0, 0.1, 50)}
    ours = model.simulate(window(), values, extra)["level"]
    np.testing.assert_allclose(ours, python.simulate(window(), values, extra)["level"], rtol=1e-13)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_hidden_leak_is_found_as_with_the_python_model(tmp_path, python, recording, fmi):
    model = read_model(fmu(tmp_path, fmi=fmi)).build([recording])
    ours = examine(model, [recording], Settings())
    theirs = examine(python, [recording], Settings())
    assert ours.status == theirs.status == "explained"
    assert ours.named == theirs.named == ["leak"]
    a, b = ours.findings[0].parameters[0], theirs.findings[0].parameters[0]
    assert (a.value, a.low, a.high) == pytest.approx((b.value, b.low, b.high), rel=1e-6)
    assert a.low < 0.05 < a.high


def test_without_a_companion_the_leak_is_found_by_the_defaults(tmp_path, recording):
    model = read_model(fmu(tmp_path, companion="")).build([recording])
    assert [p.name for p in model.nuisances] == ["area", "start_level"]
    assert examine(model, [recording], Settings()).named == ["leak"]


@pytest.mark.parametrize(
    "defines", [(), ("BAD_RESET",), ("NO_RESET",)], ids=["resets", "resets badly", "cannot"]
)
def test_a_simulation_does_not_depend_on_those_before_it(tmp_path, defines):
    simulate = read_model(fmu(tmp_path, defines=defines)).build(()).simulate
    alone = simulate(window(), {"start_level": 1.0}, {})["level"]
    simulate(window(), {"area": 0.5, "leak": 0.9, "start_level": 3.0}, {})
    np.testing.assert_array_equal(simulate(window(), {"start_level": 1.0}, {})["level"], alone)
    library = simulate._instance._library.dll  # type: ignore[attr-defined]
    assert library.instances() == 1


def test_an_fmu_that_never_gives_the_same_is_refused(tmp_path):
    simulate = read_model(fmu(tmp_path, defines=("NOISY",))).build(()).simulate
    with pytest.raises(FmuError, match="gives other outputs when the same simulation is repeated"):
        simulate(window(), {}, {})


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_failing_step_says_when_and_at_which_values_and_counts_as_divergence(tmp_path, recording, fmi):
    model = read_model(fmu(tmp_path, FAILS, fmi=fmi)).build([recording])
    with pytest.raises(
        StepError,
        match=r"tank\.fmu: doStep fails at 0 s \(error\): the level became .* at 0 s; values: area=0\.6 m2",
    ):
        model.simulate(window(), {"area": 0.6}, {})
    assert issubclass(StepError, OverflowError)
    # after the failure the next simulation is sound, and a search that meets such values goes on
    assert np.isfinite(model.simulate(window(), {"area": 1.0}, {})["level"]).all()
    assert examine(model, [recording], Settings()).named == ["leak"]


def test_an_fmu_that_fails_at_its_own_values_is_reported_in_one_line(tmp_path, recording):
    model = read_model(fmu(tmp_path, FAILS, companion="[values]\narea = 0.6\n")).build([recording])
    with pytest.raises(BadModel, match=r"model Tank: tank\.fmu: doStep fails") as caught:
        examine(model, [recording], Settings())
    assert "instance.py" not in str(caught.value)


def test_units_of_the_fmu_are_converted(tmp_path):
    heater = Source(
        "Heater",
        (Var("flow", "input", 0.0, "l/s"), Var("t", "output", None, "degC"), Var("base", "parameter", 20.0, "degC")),
        "return 0;",
        "v[T] = v[BASE] + v[FLOW];",
        0.1,
    )  # fmt: skip
    model = read_model(fmu(tmp_path, heater, companion="")).build(())
    assert (model.inputs["flow"], model.outputs["t"]) == ("m^3/s", "K")
    [base] = model.nuisances
    assert (base.value, base.typical) == (pytest.approx(293.15), pytest.approx(1.0))  # 5 % of 20 degrees
    w = replace(window(), known={"flow": np.full(50, 0.003)})
    np.testing.assert_allclose(model.simulate(w, {"base": 303.15}, {})["t"], 273.15 + 30.0 + 3.0)


def test_an_input_that_is_not_held_is_integrated_to_second_order(tmp_path):
    integrator = Source(
        "Integrator",
        (Var("u", "input", 0.0), Var("y", "output", 0.0, "", 'initial="exact"'), Var("direct", "output")),
        "v[Y] += h * v[U]; return 0;",
        "v[DIRECT] = v[U];",
        0.1,
    )
    model = read_model(fmu(tmp_path, integrator, companion="")).build(())
    assert [(p.name, p.scope) for p in model.nuisances] == [("y", "window")]
    t = window().time_s
    seen = model.simulate(replace(window(), known={"u": 2.0 * t}), {"y": 1.0}, {})
    np.testing.assert_allclose(seen["y"], 1.0 + t**2, atol=1e-12)  # of u = 2 t
    np.testing.assert_array_equal(seen["direct"], 2.0 * t)


@pytest.mark.parametrize(
    ("companion", "message"),
    [
        (
            "[effects.leek]\n",
            r"effects\.leek\.parameter names 'leek', which tank\.fmu has not .*did you mean 'leak'",
        ),
        ("[parameters.aera]\n", r"parameters\.aera names 'aera'.*did you mean 'area'"),
        ("[outputs.levle]\nbias = 1.0\n", r"outputs\.levle is not a known key; did you mean 'level'"),
        ("[parameters.level]\n", r"a output whose start value cannot be set"),
        ("[parameters.area]\nlower = 1.5\n", r"parameters\.area\.value = 1 m2 is outside 1\.5\.\.2 m2"),
        ("[initial.start_level]\nguess = 'lvl'\n", r"guess = 'lvl' is no output of the FMU; it has level"),
        ("windows_s = 3\n", "windows_s is not a known key; did you mean 'window_s'"),
    ],
)
def test_a_mistake_in_the_companion_names_file_key_and_the_closest_name(tmp_path, companion, message):
    with pytest.raises(ConfigurationError, match=message) as caught:
        read_model(fmu(tmp_path, companion=companion))
    assert str(caught.value).startswith(str(tmp_path / "tank.toml"))
    assert "\n" not in str(caught.value)


def archive(folder: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(folder / "bad.fmu", "w") as written:
        for name, content in files.items():
            written.writestr(name, content)
    return folder / "bad.fmu"


def described(source: Source = TANK) -> bytes:
    from tests.fmi.fmus import description

    return description(source, 2).encode()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a": b""}, "has no modelDescription.xml, so it is no FMU"),
        ({"modelDescription.xml": b"<a"}, "cannot be read"),
        ({"modelDescription.xml": b"<!DOCTYPE a><a/>"}, "declares a document type"),
        ({"modelDescription.xml": b"", "../x": b""}, "would leave its folder"),
        ({"modelDescription.xml": b"", "/etc/x": b""}, "would leave its folder"),
        ({"modelDescription.xml": b"", "a\\..\\..\\x": b""}, "would leave its folder"),
        ({"modelDescription.xml": b"", "C:\\x": b""}, "would leave its folder"),
        ({"modelDescription.xml": described().replace(b'modelIdentifier="Tank"', b"")}, "has no modelIdentifier"),
        ({"modelDescription.xml": described(replace(TANK, name="T" * 250))}, "'T{80}', which is no name of a binary"),
        ({"modelDescription.xml": described()}, "has no binary for this computer .*it has none at all"),
        ({"modelDescription.xml": described(), "binaries/win64/Tank.dll": b""}, "it has win64"),
        ({"modelDescription.xml": described(), "binaries/linux64/Tank.so": b"?"}, "its binary cannot be loaded"),
        (
            {"modelDescription.xml": described(replace(TANK, kind="ModelExchange"))},
            "is for model exchange only and brings no solver",
        ),
    ],
)  # fmt: skip
def test_an_archive_that_is_no_usable_fmu_is_refused_in_one_line(tmp_path, monkeypatch, files, message):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(FmuError, match=message) as caught:
        read_model(archive(tmp_path, files)).build(()).simulate(window(), {}, {})
    assert "\n" not in str(caught.value)
    del caught
    assert Path.cwd() == ROOT or Path.cwd().is_dir()


def test_what_is_no_zip_is_refused_and_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "a.fmu").write_bytes(b"no zip")
    with pytest.raises(UserError, match="is no zip archive"):
        read_model(tmp_path / "a.fmu")
    assert list(tmp_path.glob(f"{FOLDER}*")) == []


UNREADABLE = "is no zip archive that can be read"


@pytest.mark.parametrize(
    ("method", "old", "new", "message"),
    [
        (zipfile.ZIP_STORED, "\u00b5.txt".encode(), b"\xff\xff.txt", UNREADABLE),  # no UTF-8
        (zipfile.ZIP_STORED, "\u00b5.txt".encode(), b"\0\0.txt", "has a file without a name"),
        (
            zipfile.ZIP_LZMA,
            b"\x09\x04\x05\x00\x5d",
            b"\x09\x04\x05\x00\xff",
            UNREADABLE,
        ),  # no properties of LZMA
    ],
)
def test_an_archive_damaged_in_names_or_compression_is_refused_in_one_line(
    tmp_path, method, old, new, message
):
    with zipfile.ZipFile(tmp_path / "bad.fmu", "w", method) as written:
        written.writestr("modelDescription.xml", described())
        written.writestr("\u00b5.txt", b"text")
    content = (tmp_path / "bad.fmu").read_bytes()
    assert old in content
    (tmp_path / "bad.fmu").write_bytes(content.replace(old, new))
    with pytest.raises(FmuError, match=message) as caught:
        read_model(tmp_path / "bad.fmu")
    assert "\n" not in str(caught.value)


def test_an_archive_that_would_unpack_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("fmi.archive.MOST_BYTES", 1000)
    with pytest.raises(FmuError, match="would unpack to"):
        read_model(archive(tmp_path, {"modelDescription.xml": b"x" * 1001}))


def test_the_folder_of_an_fmu_goes_with_it_and_that_of_a_killed_process_with_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    left = tmp_path / f"{FOLDER}left"
    left.mkdir()
    (left / ".in-use").touch()
    first = Unpacked(fmu(tmp_path))
    assert not left.exists()
    second = Unpacked(fmu(tmp_path))
    assert first.folder.is_dir()  # its lock is held
    first.close()
    second.close()
    assert list(tmp_path.glob(f"{FOLDER}*")) == []


def test_the_companion_that_describe_writes_changes_nothing(tmp_path, recording):
    from fmi.skeleton import companion_text, lines_of

    file = fmu(tmp_path, companion="")
    before = read_model(file).build([recording])
    file.with_suffix(".toml").write_text(companion_text(file), encoding="utf-8")
    after = read_model(file).build([recording])
    without = {"simulate": before.simulate}
    assert replace(after, **without) == before
    shown = "\n".join(lines_of(file))
    assert "leak [1/s] start 0 0 to 1 (effect): water is lost in proportion to the level" in shown
    assert "against the standard" not in shown
