"""What the tests of the written C share: a recorded drive, and the builds."""

import numpy as np
import pytest

from deploy.c.estimators import estimator_files
from deploy.c.project import RUNTIME, write_project
from ecu.calibration import calibration_table, load_calibration
from tests.deploy.c.building import STRICT, BuiltEstimators, build, write
from tests.deploy.c.drives import driven_rows

CALIBRATION = load_calibration("l60")


@pytest.fixture(scope="session")
def rows():
    """Inputs of a machine that is driven hard: a second with every sensor, 0.1 s each without some of them."""
    return driven_rows(np.random.default_rng(2024), cycles=100, failing=10)


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    """Folder with the estimators as they are exported."""
    folder = write(tmp_path_factory.mktemp("c"), estimator_files())
    (folder / "real.h").write_text((RUNTIME / "real.h").read_text())
    return folder


@pytest.fixture(scope="session")
def single(written):
    """The estimators in single precision, as they are exported."""
    library = build([written / "estimators.c"], written / "single.so", *STRICT, "-shared", "-fPIC")
    return BuiltEstimators(library, np.float32, CALIBRATION.parameters)


@pytest.fixture(scope="session")
def double(written):
    """The same text in double precision."""
    library = build(
        [written / "estimators.c"], written / "double.so", *STRICT, "-shared", "-fPIC", "-DECU_DOUBLE"
    )
    return BuiltEstimators(library, np.float64, CALIBRATION.parameters)


@pytest.fixture(scope="session")
def perturbed(tmp_path_factory):
    """Double precision with every result changed at random by the rounding of single precision."""
    folder = write(tmp_path_factory.mktemp("perturbed"), estimator_files(perturbed=True))
    (folder / "real.h").write_text((RUNTIME / "real.h").read_text())
    library = build(
        [folder / "estimators.c"],
        folder / "perturbed.so",
        "-std=c99",
        "-O2",
        "-shared",
        "-fPIC",
        "-DECU_DOUBLE",
        "-DECU_PERTURBED",
    )
    return BuiltEstimators(library, np.float64, rounded(CALIBRATION.parameters))


def rounded(record):
    """Every number of a calibration in single precision."""
    return type(record)(
        *(rounded(value) if isinstance(value, tuple) else float(np.float32(value)) for value in record)
    )


@pytest.fixture(scope="session")
def ecu_sources(tmp_path_factory):
    """The exported folder."""
    folder = tmp_path_factory.mktemp("ecu")
    write_project(folder, CALIBRATION, calibration_table("l60").values)
    return folder


@pytest.fixture(scope="session")
def ecu_double(ecu_sources):
    """The whole ECU in double precision."""
    return build(
        sorted(ecu_sources.glob("*.c")),
        ecu_sources / "double.so",
        *STRICT,
        "-shared",
        "-fPIC",
        "-DECU_DOUBLE",
    )


@pytest.fixture(scope="session")
def ecu_single(ecu_sources):
    """The whole ECU as it is exported."""
    return build(sorted(ecu_sources.glob("*.c")), ecu_sources / "single.so", *STRICT, "-shared", "-fPIC")
