"""The public face for authors of models, and files that they wrote before names changed."""

from pathlib import Path

import pytest

import discrepancy.model as public
from diagnosis.models import MOVED, NoModel, find_model
from discrepancy.model import Parameter


def test_everything_that_is_public_can_be_imported_from_one_place() -> None:
    for name in public.__all__:
        assert hasattr(public, name)


def test_parameters_are_made_with_the_names_of_before() -> None:
    old = Parameter(name="sign", unit="1", whole=True, probes=(1.0, 2.0), scope="begin", prior_sd=1.0)  # type: ignore[arg-type]
    new = Parameter(
        name="sign",
        unit="1",
        discrete=True,
        trial_steps=(1.0, 2.0),
        scope="initial_uncertainty",
        prior_sd=1.0,
    )
    assert old == new


@pytest.mark.parametrize("module", MOVED)
def test_an_import_of_a_moved_module_names_its_new_place(module: str, tmp_path: Path) -> None:
    file = tmp_path / "tank.py"
    file.write_text(f"import numpy\nfrom {module} import anything\n")
    with pytest.raises(NoModel, match=f"line 2: {module} has moved.*{MOVED[module]}"):
        find_model(str(file))


def test_a_parameter_outside_its_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match=r"outside \[0"):
        Parameter(name="cd", unit="1", value=-1.0, lower=0.0, upper=2.0)
