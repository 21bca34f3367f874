"""Calibration of the ECU for one machine: what the estimators know, thresholds, limits.

Read once from TOML, checked, frozen, in SI. The ECU's own numbers: it never sees a machine file of
the plant.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from configuration import CheckedTable, ConfigurationError, find_file
from ecu.detection_rules import DETECTION_QUANTITIES, SECTIONS, DetectionRules, read_detection
from ecu.estimators.parameters import (
    Arm,
    Axle,
    Body,
    Bucket,
    Contact,
    Cylinders,
    Digging,
    Geometry,
    LinkageDrive,
    MagicFormula,
    Parameters,
    PredictionRules,
    Sensors,
    TiltLinkage,
    Wheel,
)
from ecu.quantity import Quantity, read_section
from ecu.rules import AlarmRules, InputRules, LimitRules, WarningRules

CALIBRATIONS = Path(__file__).resolve().parent / "calibrations"


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Everything that makes the ECU fit one machine."""

    name: str
    parameters: Parameters
    limits: LimitRules
    warnings: WarningRules
    alarms: AlarmRules
    inputs: InputRules
    detection: DetectionRules


def _q(key: str, low: float, high: float) -> Quantity:
    return Quantity(key, low, high)


_INERTIAS = {
    "roll_inertia": _q("roll_inertia_kg_m2", 1, 1e6),
    "pitch_inertia": _q("pitch_inertia_kg_m2", 1, 1e6),
    "yaw_inertia": _q("yaw_inertia_kg_m2", 1, 1e6),
}
_BODY = {"mass": _q("mass_kg", 1, 1e5), "x": _q("x_m", -10, 10), "z": _q("z_m", 0, 5), **_INERTIAS}

_TABLES: Mapping[str, tuple[type, Mapping[str, Quantity]]] = {
    "geometry": (
        Geometry,
        {
            "front_length": _q("front_length_m", 0.1, 5),
            "rear_length": _q("rear_length_m", 0.1, 5),
            "front_track": _q("front_track_m", 0.5, 5),
            "rear_track": _q("rear_track_m", 0.5, 5),
            "pivot_height": _q("pivot_height_m", 0.1, 3),
            "articulation_stop": _q("articulation_stop_deg", 1, 80),
        },
    ),
    "front": (Body, _BODY),
    "rear": (Body, _BODY),
    "arm": (
        Arm,
        {
            "pivot_x": _q("pivot_x_m", -2, 5),
            "pivot_z": _q("pivot_z_m", 0.1, 5),
            "length": _q("length_m", 0.2, 10),
            "mass": _q("mass_kg", 1, 1e5),
            "along": _q("along_m", -5, 10),
            "above": _q("above_m", -2, 2),
            **_INERTIAS,
        },
    ),
    "bucket": (
        Bucket,
        {
            "mass": _q("mass_kg", 1, 1e5),
            "carried": _q("carried_deg", -120, 120),
            "forward": _q("forward_m", -3, 3),
            "above": _q("above_m", -3, 3),
            "payload_forward": _q("payload_forward_m", -3, 3),
            "payload_above": _q("payload_above_m", -3, 3),
            **_INERTIAS,
            "payload_roll_gyration": _q("payload_roll_gyration_m", 0, 3),
            "payload_pitch_gyration": _q("payload_pitch_gyration_m", 0, 3),
            "payload_yaw_gyration": _q("payload_yaw_gyration_m", 0, 3),
        },
    ),
    "digging": (
        Digging,
        {
            "edge_forward": _q("edge_forward_m", -3, 3),
            "edge_above": _q("edge_above_m", -3, 3),
            "force": _q("force_kn", 0.1, 500),
            "speed": _q("speed_kmh", 0, 50),
            "settling_time": _q("settling_time_s", 0, 10),
        },
    ),
    "linkage_drive": (
        LinkageDrive,
        {
            "lift_up": _q("lift_up_deg_s", 1, 102),
            "lift_down": _q("lift_down_deg_s", 1, 102),
            "tilt_back": _q("tilt_back_deg_s", 1, 102),
            "tilt_forward": _q("tilt_forward_deg_s", 1, 102),
            "lag": _q("lag_ms", 1, 1000),
            "cushion": _q("cushion_ms", 1, 2000),
            "lift_low": _q("lift_low_deg", -90, 90),
            "lift_high": _q("lift_high_deg", -90, 90),
            "tilt_low": _q("tilt_low_deg", -120, 120),
            "tilt_high": _q("tilt_high_deg", -120, 120),
        },
    ),
    "axle": (
        Axle,
        {
            "mass": _q("mass_kg", 1, 1e5),
            "height": _q("height_m", 0.1, 3),
            "roll_inertia": _q("roll_inertia_kg_m2", 1, 1e6),
        },
    ),
    "wheel": (
        Wheel,
        {
            "unloaded_radius": _q("unloaded_radius_m", 0.1, 3),
            "nominal_load": _q("nominal_load_kn", 0.1, 1000),
            "radial_linear": _q("radial_linear", 0.1, 1e4),
            "radial_quadratic": _q("radial_quadratic", 1e-3, 1e4),
            "front_stiffening": _q("front_stiffening", 0.1, 3),
            "rear_stiffening": _q("rear_stiffening", 0.1, 3),
            "front_pressure": _q("front_pressure_bar", 0.5, 10),
            "rear_pressure": _q("rear_pressure_bar", 0.5, 10),
            "spin_inertia": _q("spin_inertia_kg_m2", 0.1, 1e5),
            "rolling_resistance": _q("rolling_resistance", 0, 0.3),
            "slip_stiffness": _q("slip_stiffness", 1, 60),
            "cornering_stiffness": _q("cornering_stiffness_per_rad", 1, 60),
            "cornering_load": _q("cornering_load", 0.5, 20),
            "lateral_peak": _q("lateral_peak", 0.05, 2),
            "friction": _q("friction", 0.05, 2),
            "pneumatic_trail": _q("pneumatic_trail_m", 0, 0.5),
            "longitudinal_relaxation": _q("longitudinal_relaxation_m", 0.01, 5),
            "low_speed": _q("low_speed_m_s", 0.05, 2),
        },
    ),
    "magic_formula": (
        MagicFormula,
        {
            "nominal_load": _q("nominal_load_kn", 0.1, 1000),
            "nominal_pressure": _q("nominal_pressure_bar", 0.5, 10),
            "PCx1": _q("PCx1", 1, 3),
            "PDx1": _q("PDx1", 0.01, 3),
            "PEx1": _q("PEx1", -20, 1),
            "PKx1": _q("PKx1", 0.1, 60),
            **{
                name: _q(name, -100, 100)
                for name in [
                    "PDx2",
                    "PEx2",
                    "PEx3",
                    "PEx4",
                    "PKx2",
                    "PKx3",
                    "PHx1",
                    "PHx2",
                    "PVx1",
                    "PVx2",
                    "Ppx1",
                    "Ppx2",
                    "Ppx3",
                    "Ppx4",
                ]
            },
        },
    ),
    "sensors": (
        Sensors,
        {
            "imu_x": _q("imu_x_m", -5, 5),
            "imu_y": _q("imu_y_m", -3, 3),
            "imu_z": _q("imu_z_m", 0, 5),
            "rate_time": _q("rate_time_ms", 0, 500),
            "wheel_time": _q("wheel_time_ms", 0, 500),
            "speed_gain": _q("speed_gain_per_s", 0, 100),
            "speed_scatter": _q("speed_scatter_m_s", 1e-3, 5),
            "speed_scatter_slope": _q("speed_scatter_slope", 0, 1),
            "slope_levelling": _q("slope_levelling_s", 0, 1000),
        },
    ),
    "contact": (
        Contact,
        {
            "settling_time": _q("settling_time_s", 0, 10),
            "bias_time": _q("bias_time_s", 0.1, 1000),
            "latency": _q("latency_ms", 0, 100),
            "damping": _q("damping_kn_s_per_m", 0, 100),
        },
    ),
    "prediction": (
        PredictionRules,
        {
            "horizon": _q("horizon_s", 0.1, 5),
            "step": _q("step_ms", 5, 100),
            "steering_lag": _q("steering_lag_ms", 1, 1000),
            "steering_acceleration": _q("steering_acceleration_deg_s2", 10, 10000),
            "cushion": _q("cushion_ms", 1, 2000),
            "acceleration_memory": _q("acceleration_memory_s", 0.01, 10),
            "demand_hold": _q("demand_hold_s", 0, 5),
            "limit_hold": _q("limit_hold_s", 0.01, 5),
            "turn_ahead": _q("turn_ahead_s", 0, 10),
            "turn_floor": _q("turn_floor", 0, 0.9),
            "braking": _q("braking_m_s2", 0, 10),
            "braking_slack": _q("braking_slack_s", 0, 2),
            "tyre_stiffness": _q("tyre_stiffness_kn_per_m", 100, 5000),
            "roll_damping": _q("roll_damping", 0, 1),
            "margin_floor": _q("margin_floor", 0, 0.9),
            "speed_floor": _q("speed_floor", 0, 0.9),
            "largest_rate": _q("largest_rate_deg_s", 1, 51),
            "largest_speed": _q("largest_speed_kmh", 1, 51),
        },
    ),
    "limits": (
        LimitRules,
        {
            "front_torque": _q("front_torque_kn_m", 0, 50.8),
            "rear_torque": _q("rear_torque_kn_m", 0, 50.8),
            "torque_full_margin": _q("torque_full_margin", 0, 1),
            "torque_least_margin": _q("torque_least_margin", 0, 1),
            "torque_least_share": _q("torque_least_share", 0, 1),
            "engage_margin": _q("engage_margin", 0, 1),
            "release_margin": _q("release_margin", 0, 1),
            "creep_speed": _q("creep_speed_kmh", 0, 51),
            "safe_torque": _q("safe_torque_kn_m", 0, 50.8),
            "safe_speed": _q("safe_speed_kmh", 0, 51),
            "safe_rate": _q("safe_rate_deg_s", 0, 51),
            "safe_lift_rate": _q("safe_lift_rate_deg_s", 0, 102),
            "safe_tilt_rate": _q("safe_tilt_rate_deg_s", 0, 102),
            "speed_fall": _q("speed_fall_m_s2", 0.1, 100),
            "speed_rise": _q("speed_rise_m_s2", 0.1, 100),
            "rate_rise": _q("rate_rise_deg_s2", 1, 1e4),
            "linkage_rise": _q("linkage_rise_deg_s2", 1, 1e4),
            "torque_rise": _q("torque_rise_kn_m_s", 0.1, 1e4),
        },
    ),
    "warnings": (
        WarningRules,
        {
            "attention_margin": _q("attention_margin", 0, 1),
            "warning_margin": _q("warning_margin", 0, 1),
            "imminent_margin": _q("imminent_margin", 0, 1),
            "margin_hysteresis": _q("margin_hysteresis", 0, 0.5),
            "imminent_time": _q("imminent_time_s", 0, 5),
            "spin_slip": _q("spin_slip", 0, 5),
            "lock_slip": _q("lock_slip", -1, 0),
            "lock_speed": _q("lock_speed_m_s", 0, 10),
            "axle_rating": _q("axle_rating_kn", 1, 1000),
            "stop_distance": _q("stop_distance_deg", 0, 40),
            "slope": _q("slope_deg", 0, 60),
            "payload": _q("payload_kg", 0, 1e5),
            "payload_arm": _q("payload_arm_deg", -90, 90),
            "payload_speed": _q("payload_speed_kmh", 0, 51),
        },
    ),
    "alarms": (
        AlarmRules,
        {
            "short_delay": _q("short_delay_ms", 0, 100),
            "usual_delay": _q("usual_delay_ms", 0, 1000),
            "least_on": _q("least_on_ms", 0, 5000),
            "off_delay": _q("off_delay_ms", 0, 5000),
        },
    ),
    "inputs": (
        InputRules,
        {
            "stale_cycles": _q("stale_cycles", 1, 100),
            "articulation": _q("articulation_deg", 1, 65),
            "articulation_rate": _q("articulation_rate_deg_s", 1, 160),
            "wheel_speed": _q("wheel_speed_rad_s", 1, 32),
            "wheel_torque": _q("wheel_torque_kn_m", 1, 65),
            "acceleration": _q("acceleration_m_s2", 1, 65),
            "rate": _q("rate_deg_s", 1, 160),
            "slope": _q("slope_deg", 1, 64),
            "pressure": _q("pressure_mpa", 1, 120),
            "arm": _q("arm_deg", 1, 160),
            "tilt": _q("tilt_deg", 1, 160),
            "articulation_step": _q("articulation_step_deg", 0.1, 90),
            "wheel_speed_step": _q("wheel_speed_step_rad_s", 0.1, 60),
            "linkage_step": _q("linkage_step_deg", 0.1, 90),
            "slope_step": _q("slope_step_deg", 0.1, 90),
            "frozen_frames": _q("frozen_frames", 0, 1000),
            "exchanged_frames": _q("exchanged_frames", 0, 1000),
            "turning": _q("turning_deg_s", 1, 90),
            "carried": _q("carried_m_s2", 0, 10),
            "start_up": _q("start_up_s", 0, 10),
            "recovery": _q("recovery_s", 0.1, 60),
            "least_specific_force": _q("least_specific_force_m_s2", 0, 9),
        },
    ),
}
_CYLINDERS: Mapping[str, Quantity] = {
    "base_x": _q("base_x_m", -2, 5),
    "base_z": _q("base_z_m", 0, 5),
    "pin_along": _q("pin_along_m", 0.1, 10),
    "pin_above": _q("pin_above_m", -2, 2),
    "bore": _q("bore_mm", 10, 500),
    "rod": _q("rod_mm", 0, 500),
    "count": _q("count", 1, 4),
    "back_pressure": _q("back_pressure_kpa", 0, 5000),
    "settling_time": _q("settling_time_s", 0, 60),
}
_TILT_LINKAGE: Mapping[str, Quantity] = {
    "base_x": _q("base_x_m", -2, 5),
    "base_z": _q("base_z_m", 0, 5),
    "crank_along": _q("crank_along_m", 0, 10),
    "crank_above": _q("crank_above_m", -2, 3),
    "cylinder_arm": _q("cylinder_arm_m", 0.05, 5),
    "link_arm": _q("link_arm_m", 0.05, 5),
    "between": _q("between_deg", -360, 360),
    "link": _q("link_m", 0.05, 5),
    "pin_forward": _q("pin_forward_m", -2, 2),
    "pin_above": _q("pin_above_m", -2, 2),
    "bore": _q("bore_mm", 10, 500),
    "rod": _q("rod_mm", 0, 500),
    "count": _q("count", 1, 4),
    "back_pressure": _q("back_pressure_kpa", 0, 5000),
}
_SECTIONS = frozenset(_TABLES) | SECTIONS | {"cylinders", "tilt_linkage", "name"}

QUANTITIES: Mapping[str, tuple[Quantity, ...]] = {
    **{section: tuple(quantities.values()) for section, (_, quantities) in _TABLES.items()},
    "cylinders": tuple(_CYLINDERS.values()),
    "tilt_linkage": tuple(_TILT_LINKAGE.values()),
    **DETECTION_QUANTITIES,
}
"""Every number of a calibration file: section -> its keys with unit and permitted range."""


ORDERED = (
    ("limits", "torque_least_margin", "torque_full_margin"),
    ("linkage_drive", "lift_low", "lift_high"),
    ("linkage_drive", "tilt_low", "tilt_high"),
    ("limits", "engage_margin", "release_margin"),
    ("warnings", "imminent_margin", "warning_margin"),
    ("warnings", "warning_margin", "attention_margin"),
)
"""Section and two of its fields, of which the first has to be below the second."""
WITH_AREAS = ("cylinders", "tilt_linkage")
"""Sections whose bore, rod and count become areas; the rod has to be thinner than the bore."""


def fields_of(section: str) -> Mapping[str, Quantity]:
    """The numbers of a section by field name, in the order of QUANTITIES; not of the detection's sections."""
    areas = {"cylinders": _CYLINDERS, "tilt_linkage": _TILT_LINKAGE}
    return areas[section] if section in areas else _TABLES[section][1]


def load_calibration(name_or_path: str | Path = "l60") -> Calibration:
    """A calibration by name, or from a TOML file. Raises ConfigurationError."""
    return read_calibration(calibration_table(name_or_path))


def calibration_table(name_or_path: str | Path = "l60") -> CheckedTable:
    """The unchecked table of a calibration, by name or from a TOML file. ConfigurationError where it cannot be read."""
    return CheckedTable.from_file(find_file(name_or_path, CALIBRATIONS, "calibration"))


def read_calibration(top: CheckedTable) -> Calibration:
    """The calibration of a table with all its checks. Raises ConfigurationError."""
    for section in top.values:
        if section not in _SECTIONS:
            raise top.unknown(section, _SECTIONS)
    if "name" not in top:
        raise top.error("name", "is missing: name the machine this calibration fits")
    name = top.text("name")

    calibration = Calibration(
        name=name,
        parameters=Parameters(**{section: _section(top, section) for section in Parameters._fields}),
        limits=_section(top, "limits"),
        warnings=_section(top, "warnings"),
        alarms=_section(top, "alarms"),
        inputs=_section(top, "inputs"),
        detection=read_detection(top),
    )
    _check(calibration, top.file)
    return calibration


def reread(calibration: Calibration, top: CheckedTable, section: str) -> Calibration:
    """`calibration` with one of its sections read anew from `top`, checked as in a whole file; not for [detection].

    A hundredth of the time of reading all sections: for changes while the ECU runs. Raises ConfigurationError.
    """
    part = _section(top, section)
    if section in Parameters._fields:
        changed = replace(calibration, parameters=calibration.parameters._replace(**{section: part}))
    else:
        changed = replace(calibration, **{section: part})
    _check(changed, top.file)
    return changed


def _section(top: CheckedTable, section: str) -> Any:
    """The part of a calibration that a section of the file makes."""
    if section in WITH_AREAS:
        with_areas = Cylinders if section == "cylinders" else TiltLinkage
        return with_areas(**_with_areas(top, section, fields_of(section)))
    kind, quantities = _TABLES[section]
    return kind(**read_section(top, section, quantities))


def _with_areas(top: CheckedTable, section: str, quantities: Mapping[str, Quantity]) -> dict[str, float]:
    """A section with bore, rod and count of its cylinders turned into their areas."""
    values = read_section(top, section, quantities)
    bore, rod, count = values.pop("bore"), values.pop("rod"), values.pop("count")
    if not rod < bore:
        raise ConfigurationError(
            f"{top.file}: {section}.rod_mm = {rod * 1e3:g} mm is not below the bore of {bore * 1e3:g} mm: were they swapped?"
        )
    area = count * math.pi / 4
    return {**values, "head_area": area * bore**2, "rod_area": area * (bore**2 - rod**2)}


def _check(calibration: Calibration, file: str) -> None:
    """Refuse values that are possible each but not together."""
    p, limits, warnings = calibration.parameters, calibration.limits, calibration.warnings
    if not p.rear.x < 0 < p.front.x:
        raise ConfigurationError(
            f"{file}: rear.x_m = {p.rear.x:g} m and front.x_m = {p.front.x:g} m do not lie on their own sides of the "
            "joint (rear below 0, front above): x is forward of the joint"
        )
    parts = {"limits": limits, "warnings": warnings, "linkage_drive": p.linkage_drive}
    for section, low_field, high_field in ORDERED:
        low, high = getattr(parts[section], low_field), getattr(parts[section], high_field)
        if not low < high:
            keys = fields_of(section)
            low_key, high_key = f"{section}.{keys[low_field].key}", f"{section}.{keys[high_field].key}"
            raise ConfigurationError(f"{file}: {low_key} = {low:g} is not below {high_key} = {high:g}")
