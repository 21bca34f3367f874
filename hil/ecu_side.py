"""Builds the virtual ECU of the bench; a module of its own, so that the ECU's process never loads the plant."""

from typing import Literal

from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle

Form = Literal["corrected", "printed"]
FORMS: tuple[Form, ...] = ("corrected", "printed")
CALIBRATION = "l60"


def ecu_cycle(
    *, form: Form, limits: bool, calibration: str = CALIBRATION, detect_faults: bool = False
) -> EcuCycle:
    """A fresh ECU.

    form: the estimators' equations, corrected or as printed in the thesis; limits: whether it limits the machine;
    calibration: name or TOML file; detect_faults: whether its sensors are tested against each other.
    """
    return EcuCycle(
        load_calibration(calibration), form=form, limits_enabled=limits, detect_faults=detect_faults
    )
