"""Builds the virtual ECU of the bench; a module of its own, so that the ECU's process never loads the plant."""

from ecu.calibration import load_calibration
from ecu.core import PYTHON, Core, Ecu, Form

FORMS: tuple[Form, ...] = ("corrected", "printed")
CALIBRATION = "l60"


def ecu_cycle(
    *,
    form: Form,
    limits: bool,
    calibration: str = CALIBRATION,
    detect_faults: bool = False,
    core: Core = PYTHON,
) -> Ecu:
    """A fresh ECU.

    form: the estimators' equations, corrected or as printed in the thesis; limits: whether it limits the machine;
    calibration: name or TOML file; detect_faults: whether its sensors are tested against each other; core: what computes.
    """
    return core.ecu(load_calibration(calibration), form=form, limits=limits, detect_faults=detect_faults)
