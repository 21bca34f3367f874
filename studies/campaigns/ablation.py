"""Ablation: the contribution of each source to the normal-force estimate, from the same recorded drive with one source removed."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from dbc import loader_database
from ecu.calibration import Calibration
from ecu.estimators.columns import estimate_columns
from ecu.estimators.parameters import Parameters
from ecu.estimators.signals import Inputs
from ecu.inputs import InputReceiver, estimator_inputs
from ecu.outputs import TICK_NS
from hil.lockstep import ECU_PHASE_NS

Floats = NDArray[np.float64]
Variant = Callable[[Floats, Parameters], tuple[Floats, Parameters]]

ON_THE_BUS_S = 0.001
"""Time from the start of a cycle to the arrival of its NormalForces frame, the first frame of the cycle."""


def inputs_of(frames: Sequence[Frame], calibration: Calibration) -> tuple[Floats, Floats]:
    """Inputs of the estimators in a lockstep run: times of the cycles [s], and rows of Inputs.

    frames: of the machine, in the order of their arrival. The rows begin when every input has been received.
    """
    hearing = InputReceiver(calibration, loader_database())
    times: list[float] = []
    rows: list[Inputs] = []
    waiting = iter(frames)
    frame = next(waiting, None)
    # the cycles of the lockstep run itself: inputs have the age that they had there
    for now_ns in range(ECU_PHASE_NS, frames[-1].at_ns + TICK_NS, TICK_NS):
        while frame is not None and frame.at_ns <= now_ns:
            hearing.receive(frame, frame.at_ns)
            frame = next(waiting, None)
        received = hearing.gather(now_ns)
        # once begun, without gaps: the estimators keep states from row to row
        if rows or not received.stale:
            times.append(now_ns * 1e-9)
            rows.append(
                estimator_inputs(received, TICK_NS * 1e-9, calibration.parameters.prediction.largest_rate)
            )
    return np.array(times), np.array(rows)


def _whole(inputs: Floats, parameters: Parameters) -> tuple[Floats, Parameters]:
    return inputs, parameters


def _contact(**changes: float) -> Variant:
    def variant(inputs: Floats, parameters: Parameters) -> tuple[Floats, Parameters]:
        return inputs, parameters._replace(contact=parameters.contact._replace(**changes))

    return variant


def _deaf(*flags: str) -> Variant:
    def variant(inputs: Floats, parameters: Parameters) -> tuple[Floats, Parameters]:
        changed = inputs.copy()
        # by the flag of usability: the estimator then goes the way that it goes when a sensor fails
        changed[:, [Inputs._fields.index(flag) for flag in flags]] = 0.0
        return changed, parameters

    return variant


VARIANTS: Mapping[str, Variant] = {
    "everything": _whole,
    "not carried ahead by the latency": _contact(latency=0.0),
    "without the tyres' damping": _contact(damping=0.0),
    "without following the tilt: balance of forces alone": _contact(settling_time=0.0),
    "acceleration from the wheels instead of the inertial sensor": _deaf(
        "acceleration_usable", "rates_usable"
    ),
    "without pressures: no payload": _deaf("pressure_usable"),
}


def estimated(
    inputs: Floats, parameters: Parameters, times: Floats
) -> dict[str, tuple[Floats, NDArray[np.float64]]]:
    """Per variant: arrival of the estimates [s] and normal forces, shape (n, 4) [N]."""
    found = {}
    for name, variant in VARIANTS.items():
        rows, changed = variant(inputs, parameters)
        found[name] = (times + ON_THE_BUS_S, estimate_columns(rows, changed, prediction=False)[:, :4])
    return found
