"""The thesis' printed estimators as a model, so that the diagnosis finds their missing terms in recordings.

Inputs are the measured motion and, for the turning torque, the measured tyre forces, as in the thesis (4.6). Outputs are the quantities
with which the thesis compares its estimators: normal forces of the wheels, lateral acceleration, torque at the joint. The baseline is the
print ((71)-(87) as solved, the acceleration of 2.5, (93) and (94)). An effect is a correction that somebody might propose, right or wrong,
from 0 (print) to 1 (complete correction); the model does not contain which of them are right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.models.loader.model import load_run
from discrepancy.models.printed_forms import Corrections, estimate
from discrepancy.models.printed_slope import without_lean
from discrepancy.signals.recording import Array, Recording, Signal, signal
from ecu.calibration import load_calibration
from ecu.estimators.tyres.wheels import radius
from plant.unit.signals import WHEELS

STEP_S: Final = 0.5  # longer than the rocking of the machine on its tyres (1.3 to 2.5 Hz), which quasi-static estimators do not contain

SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
NORMAL = tuple(f"normal_force_{wheel}" for wheel in WHEELS)
FORCES = tuple(f"{along}_force_{wheel}" for along in ("longitudinal", "lateral") for wheel in WHEELS)
ANGLES = ("articulation_angle", "roll_angle", "pitch_angle", "lift_arm_angle", "tilt_angle")
RATES = ("articulation_rate", "yaw_rate")

ROLL, SIDE, PITCH, TORQUE = (
    "roll balance (80)",
    "lateral acceleration (2.5)",
    "pitch balance (79)",
    "turning torque (94)",
)


def _share(
    parameter: str, place: str, sentence: str, equation: str, excited: str, *, size: float = 1.0,
    least: float = -0.5,
    most: float = 2.0, **apart: str
) -> Effect:  # fmt: skip
    """A correction with a share: 0 the print, 1 the complete correction. apart: by other effect, the drive that distinguishes the two."""
    return Effect(
        name=parameter.replace("_", " "),
        sentence=sentence,
        equation=equation,
        parameters=(Parameter(name=parameter, unit="1", lower=least, upper=most, typical=size),),
        kind="physics",
        place=place,
        excited_by=excited,
        confusable={other.replace("_", " "): how for other, how in apart.items()},
    )


def _error(
    parameter: str,
    unit: str,
    size: float,
    place: str,
    sentence: str,
    equation: str,
    excited: str,
    *,
    sensor: bool,
) -> Effect:
    """An assumed or measured value that is wrong by `size` or more."""
    return Effect(
        name=parameter.replace("_", " "),
        sentence=sentence,
        equation=equation,
        parameters=(
            Parameter(name=parameter, unit=unit, lower=-10.0 * size, upper=10.0 * size, typical=size),
        ),
        kind="sensor" if sensor else "physics",
        place=place,
        excited_by=excited,
    )


LIBRARY = (
    _share("pivot_arm", ROLL, "the force at the rear axle's pivot has an arm about the centre of gravity when the machine is articulated",
           "sum M_x + Y_cog F_zR", "held turns", mirrored_joint="the size of the offset: twice the arm of the wheels, or the pivot's"),
    _share("centripetal", SIDE, "in a turn the machine is accelerated towards its inside", "a_y + v omega", "turns at several speeds",
           pivot_arm="turns at several speeds: it grows with the square, the arm not at all"),
    _share("yaw_acceleration", SIDE, "the centre of gravity is flung sideways when the yaw rate changes", "a_y + (l_r + X_cog) omega'",
           "quick articulation"),
    _share("trunnion", PITCH, "longitudinal forces act at the ground: the trunnion of the rear axle carries their pitch moment",
           "Z_cog + (m_a/m) h_a instead of Z_cog - Z_R/2", "braking", higher="fast turns: a height acts on roll as well"),
    _share("wheel_spin", PITCH, "the wheels' own spin takes part in the pitch moment", "sum M_y + sum J_w Omega'", "braking",
           trunnion="a wheel that spins without the machine accelerating"),
    _share("arm_rotation", "centre of gravity (37), (42)", "the whole lift arm turns about its own pivot, the payload with it", "full rotation about (x_p, z_p)",
           "loaded, braking and fast turns", higher="arm level and arm down: a height is the same in both"),
    _share("lateral_share", ROLL, "the rear pivot bears another share of the lateral force than half", "F_yR = (1/2 + s) m a_y", "fast turns",
           size=0.2, most=0.5),
    _share("axle_roll", ROLL, "the rear axle does not oscillate freely but bears part of the roll moment", "M_p = s m Z_cog a_y", "fast turns",
           size=0.2),
    _share("mirrored_joint", "centre of gravity (40)", "the centre of gravity moves to the other side when the joint turns", "Y_cog (1 - 2 s)",
           "held turns"),
    _share("mirrored_side", ROLL, "the lateral force has the sign of the other lateral axis", "a_y (1 - 2 s)", "banked ground, turns"),
    _share("rotation", TORQUE, "the front axle's forces are turned into the rear frame's axes by a rotation",
           "F_x cos d - F_y sin d, F_x sin d + F_y cos d instead of (93)", "turns", torque_gain="a turn without drive: a gain keeps the shape"),
    _share("about_joint", TORQUE, "the moment is taken about the joint, not about the centre of gravity", "M + s r_cog x sum F", "turns under torque"),
    _share("between_halves", TORQUE, "the torque at the joint bends the machine: it is the balance of one half with its inertia, not the moment of "
           "all forces about the centre of gravity", "T = I_f omega_f' + m_f c_f n_f a_J - M_f", "turns, quick articulation",
           torque_gain="a steady turn: the moment about the centre vanishes, the torque at the joint does not"),
    _share("torque_gain", TORQUE, "the turning torque is too large by a factor", "T = (1 - s) M", "turns", size=0.5, least=0.0, most=1.0),
    _error("pneumatic_trail", "m", 0.05, TORQUE, "the tyres' lateral forces act behind the middle of the contact", "M_z = -t F_y", "turns", sensor=False),
    _error("payload_error", "kg", 300.0, "centre of gravity (37)-(42)", "the bucket carries another payload than assumed", "m_l + m", "standstill",
           sensor=False),
    _error("higher", "m", 0.1, "centre of gravity (41)", "the centre of gravity is higher than assumed", "Z_cog + z", "braking, fast turns", sensor=False),
    _error("further_ahead", "m", 0.05, "centre of gravity (36)", "the centre of gravity is further ahead than assumed", "X_cog + x", "standstill",
           sensor=False),
    _error("hub_tare", "1", 1.0, "wheel force transducers", "the transducers in the hubs do not weigh the wheels", "F_z - s m_w g", "standstill",
           sensor=True),
    _error("articulation_zero", "rad", 0.01, "articulation sensor", "the articulation sensor has an offset", "d + d0", "straight and turned", sensor=True),
    _error("roll_zero", "rad", 0.01, "slope sensor", "the slope sensor is mounted askew", "roll + r0", "standstill", sensor=True),
    _error("speed_error", "1", 0.03, "wheel speeds", "the wheels' radius is wrong", "v (1 + s)", "turns", sensor=True),
    *(fault for name in NORMAL for fault in sensor_effects(name, "N", bias=500.0, kinds=("bias", "scale"))),
    *sensor_effects("specific_force_y", "m/s^2", bias=0.1, kinds=("bias", "scale", "delay")),
    *sensor_effects("joint_torque", "N.m", bias=500.0, kinds=("bias", "delay")),
)  # fmt: skip

NUISANCES = (Parameter(name="zero.specific_force_y", unit="m/s^2", typical=0.1, prior_sd=0.1),)
"""Masses and their positions count as known, as in the thesis, whose estimators had the numbers of its simulation (5.3.1)."""


class PrintedEstimators:
    """The function of the model: the estimates for a recorded motion."""

    def __init__(self) -> None:
        self._parameters = load_calibration("l60").parameters

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Outputs on the grid."""
        rows = self._motion(window)
        made = Corrections(*(values.get(name, 0.0) for name in Corrections._fields))
        normal, side, torque = np.empty((len(rows), 4)), np.empty(len(rows)), np.empty(len(rows))
        estimate(rows, made, window.constants.get("payload", 0.0), self._parameters, normal, side, torque)
        return {
            **dict(zip(NORMAL, normal.T, strict=True)),
            "specific_force_y": side + values.get("zero.specific_force_y", 0.0),
            "joint_torque": torque,
        }

    def _motion(self, window: Window) -> Array:
        """Angles, rates, their derivatives, speed and its derivative, tyre forces, (n, COLUMNS)."""
        wheel = self._parameters.wheel
        rolled = np.mean([window[name] for name in SPEEDS], axis=0) * radius(wheel.nominal_load, 1.0, wheel)
        moving = [window[name] for name in RATES]
        changes = [np.gradient(values, window.step_s) for values in (*moving, rolled)]
        angles, forces = [window[name] for name in ANGLES], [window[name] for name in FORCES]
        return np.column_stack((*angles, *moving, changes[0], changes[1], rolled, changes[2], *forces))


def load_quasi_static(folder: Path) -> Recording:
    """A recorded run as means over STEP_S, its slope freed of what accelerations add to the sensor's reading.

    The thesis' slope is simply known: the correction is its sensor's (ADR 44), and none that the print leaves out.
    """
    run = load_run(folder)
    return replace(run, signals={name: _means(item) for name, item in without_lean(run).items()})


def _means(item: Signal) -> Signal:
    """Means over whole steps, stamped at their middle; a step without a sample is left out."""
    step = np.floor(item.time_s / STEP_S).astype(int)
    filled, place = np.unique(step, return_inverse=True)
    return signal((filled + 0.5) * STEP_S, np.bincount(place, item.value) / np.bincount(place), item.unit)


def model(_: Sequence[Recording] = (), *, without: tuple[str, ...] = ()) -> Model:
    """The printed estimators; without: effects that are not searched."""
    return Model(
        name="printed-estimator",
        sentence="the thesis' printed estimators of normal force, lateral acceleration and turning torque",
        inputs={
            **dict.fromkeys(SPEEDS, "rad/s"),
            **dict.fromkeys(ANGLES, "rad"),
            **dict.fromkeys(RATES, "rad/s"),
            **dict.fromkeys(FORCES, "N"),
        },
        outputs={**dict.fromkeys(NORMAL, "N"), "specific_force_y": "m/s^2", "joint_torque": "N.m"},
        constants={"payload": "kg"},
        nuisances=NUISANCES,
        effects=tuple(e for e in LIBRARY if e.name not in without),
        simulate=PrintedEstimators(),
        step_s=STEP_S,
        held_out_s=4.0,
    )
