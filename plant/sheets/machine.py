"""A machine: frozen values read from a TOML file, checked, in SI.

Every value of the file carries its unit in its key and its confidence and source beside it. A file
with a missing, unknown or impossible value gives one error that names file, key, value and range.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from configuration import Change, CheckedTable, ConfigurationError, find_file
from plant.effects import ActiveEffect, effects
from plant.sheets.tyre_file import with_tir

MACHINES = Path(__file__).resolve().parents[1] / "machines"

_T = TypeVar("_T")

_SCALES = {"_deg": math.radians(1.0), "_deg_per_s": math.radians(1.0)}
_UNITS = {
    "_deg_per_s": "deg/s",
    "_N_m_s_per_rad": "N m s/rad",
    "_N_m_per_rad": "N m/rad",
    "_N_m_per_s": "N m/s",
    "_N_s_per_m": "N s/m",
    "_N_per_m": "N/m",
    "_m_per_s": "m/s",
    "_kg_m2": "kg m2",
    "_N_m": "N m",
    "_deg": "deg",
    "_bar": "bar",
    "_kg": "kg",
    "_Pa": "Pa",
    "_N": "N",
    "_m": "m",
    "_s": "s",
}


def quantity(key: str, low: float, high: float, default: float | None = None) -> Any:
    """A field read from `key` of the file, within [low, high] in the key's unit; `default` where the key is absent."""
    metadata = {"key": key, "low": low, "high": high, "default": default}
    return field(metadata=metadata) if default is None else field(metadata=metadata, default=default)


def choice(key: str, *choices: str) -> Any:
    """A field read from `key` of the file: one of `choices`."""
    return field(metadata={"key": key, "choices": choices})


def _suffix(key: str) -> str:
    return next((suffix for suffix in _UNITS if key.endswith(suffix)), "")


def _read(cls: type[_T], table: CheckedTable) -> _T:
    """One dataclass of quantities from one table; unknown keys are refused."""
    values: dict[str, float | str] = {}
    for item in fields(cls):  # type: ignore[arg-type]
        if choices := item.metadata.get("choices"):
            values[item.name] = table.choice(item.metadata["key"], choices)
            continue
        key, low, high, default = (item.metadata[name] for name in ("key", "low", "high", "default"))
        suffix = _suffix(key)
        number = table.number(key, unit=_UNITS.get(suffix, "1"), low=low, high=high, default=default)
        values[item.name] = number * _SCALES.get(suffix, 1.0)
    table.finish()
    return cls(**values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """Where the joint, the axles and the inertial sensor are [m], in the straight machine."""

    wheel_centre_height: float = quantity("wheel_centre_height_m", 0.1, 2.0)  # the loaded radius
    joint_height: float = quantity("joint_height_m", 0.0, 3.0)
    front_axle_x: float = quantity("front_axle_x_m", 0.1, 5.0)  # from the joint, forward positive
    rear_axle_x: float = quantity("rear_axle_x_m", -5.0, -0.1)  # behind the joint, hence negative
    track: float = quantity("track_m", 0.5, 5.0)
    imu_x: float = quantity("imu_x_m", -5.0, 1.0)  # on the rear frame, from the joint
    imu_z: float = quantity("imu_z_m", 0.0, 5.0)  # above the ground


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A rigid body: mass [kg], centre of gravity [m] (y = 0), principal inertias about it [kg m²]."""

    mass: float = quantity("mass_kg", 1.0, 1e5)
    x: float = quantity("x_m", -10.0, 10.0)
    z: float = quantity("z_m", -2.0, 5.0)
    ixx: float = quantity("ixx_kg_m2", 0.1, 1e6)
    iyy: float = quantity("iyy_kg_m2", 0.1, 1e6)
    izz: float = quantity("izz_kg_m2", 0.1, 1e6)

    @property
    def rigid(self) -> bool:
        """Whether a rigid body can have these inertias: none exceeds the sum of the others."""
        a, b, c = sorted((self.ixx, self.iyy, self.izz))
        return c <= a + b


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What the bucket carries: centre [m] from the bucket's pin as carried, inertia at the reference mass."""

    # [kg]; the inertias below hold for it and scale with the mass
    reference_mass: float = quantity("reference_mass_kg", 1.0, 1e5)
    x: float = quantity("x_m", -3.0, 3.0)
    z: float = quantity("z_m", -3.0, 3.0)
    ixx: float = quantity("ixx_kg_m2", 0.0, 1e6)  # about its own centre [kg m²]
    iyy: float = quantity("iyy_kg_m2", 0.0, 1e6)
    izz: float = quantity("izz_kg_m2", 0.0, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheel:
    """One wheel: tyre, rim and hub, symmetric about its axle."""

    mass: float = quantity("mass_kg", 1.0, 1e4)
    spin_inertia: float = quantity("spin_inertia_kg_m2", 0.1, 1e5)  # about the axle [kg m²]
    transverse_inertia: float = quantity("transverse_inertia_kg_m2", 0.1, 1e5)  # across it


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """Steering cylinders (plant.physics.steering) as a rate servo with cushioned end stops."""

    limit: float = quantity("limit_deg", 1.0, 80.0)  # articulation to either side at the end stop [rad]
    rate_limit: float = quantity("rate_limit_deg_per_s", 0.1, 200.0)
    time_constant: float = quantity("time_constant_s", 0.005, 5.0)  # of the rate behind the demanded rate [s]
    # near a stop the rate is at most (angle left) / (this time) [s]: the cushion of a cylinder, without its hydraulics
    cushion_time_constant: float = quantity("cushion_time_constant_s", 0.02, 20.0)
    bore: float = quantity("bore_m", 0.01, 0.5)
    rod: float = quantity("rod_m", 0.0, 0.5)
    # pins of the left cylinder from the joint, straight machine [m]; the right one is its mirror image
    rear_pin_x: float = quantity("rear_pin_x_m", -3.0, 0.0)
    rear_pin_y: float = quantity("rear_pin_y_m", 0.01, 2.0)
    front_pin_x: float = quantity("front_pin_x_m", 0.0, 3.0)
    front_pin_y: float = quantity("front_pin_y_m", 0.01, 2.0)
    back_pressure: float = quantity("back_pressure_Pa", 0.0, 5e6)  # of the line that does not push [Pa]
    relief_pressure: float = quantity("relief_pressure_Pa", 6e6, 1e9)  # the cylinder yields here [Pa]


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """Pivot and stops of the rear axle."""

    pivot_height: float = quantity("pivot_height_m", 0.1, 3.0)  # above the ground [m]
    limit: float = quantity(
        "limit_deg", 0.5, 45.0
    )  # angle of the axle to either side at which it touches its stop [rad]
    stop_stiffness: float = quantity("stop_stiffness_N_m_per_rad", 0.0, 2e7)
    stop_damping: float = quantity("stop_damping_N_m_s_per_rad", 0.0, 2e5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lift:
    """Lift arm, its rate servo and its cylinders."""

    # points of the front frame: x from the joint, z above the ground [m]
    pivot_x: float = quantity("pivot_x_m", -2.0, 5.0)
    pivot_z: float = quantity("pivot_z_m", 0.1, 5.0)
    arm_length: float = quantity("arm_length_m", 0.2, 10.0)  # from the pivot to the bucket's pin [m]
    lower_limit: float = quantity(
        "lower_limit_deg", -85.0, 85.0
    )  # angles of the arm are up from the horizontal [rad]
    upper_limit: float = quantity("upper_limit_deg", -85.0, 85.0)
    carry_angle: float = quantity("carry_angle_deg", -85.0, 85.0)  # for driving
    raise_rate_limit: float = quantity("raise_rate_limit_deg_per_s", 0.1, 200.0)
    lower_rate_limit: float = quantity("lower_rate_limit_deg_per_s", 0.1, 200.0)  # positive too
    time_constant: float = quantity("time_constant_s", 0.005, 5.0)
    cushion_time_constant: float = quantity("cushion_time_constant_s", 0.02, 20.0)
    cylinder_count: float = quantity("cylinder_count", 1, 4)
    bore: float = quantity("bore_m", 0.01, 0.5)
    rod: float = quantity("rod_m", 0.0, 0.5)
    base_x: float = quantity("base_x_m", -2.0, 5.0)
    base_z: float = quantity("base_z_m", 0.0, 5.0)
    rod_pin_along: float = quantity("rod_pin_along_m", 0.1, 10.0)  # along the arm, from its pivot [m]
    rod_pin_above: float = quantity("rod_pin_above_m", -2.0, 2.0)  # square to the arm [m]
    back_pressure: float = quantity("back_pressure_Pa", 0.0, 5e6)  # of the rod side [Pa]
    relief_pressure: float = quantity("relief_pressure_Pa", 6e6, 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt:
    """Bucket tilt, its rate servo and its cylinder with bell crank and link (plant.physics.linkage)."""

    carry_angle: float = quantity(
        "carry_angle_deg", -120.0, 120.0
    )  # angles of the bucket are up from the horizontal [rad]
    lower_limit: float = quantity("lower_limit_deg", -120.0, 120.0)
    upper_limit: float = quantity("upper_limit_deg", -120.0, 120.0)
    rate_limit: float = quantity("rate_limit_deg_per_s", 0.1, 400.0)
    time_constant: float = quantity("time_constant_s", 0.005, 5.0)
    cushion_time_constant: float = quantity("cushion_time_constant_s", 0.02, 20.0)
    cylinder_count: float = quantity("cylinder_count", 1, 4)
    bore: float = quantity("bore_m", 0.01, 0.5)
    rod: float = quantity("rod_m", 0.0, 0.5)
    base_x: float = quantity("base_x_m", -2.0, 5.0)
    base_z: float = quantity("base_z_m", 0.0, 5.0)
    # pivot of the bell crank: along and above the arm, from the arm's pivot [m]
    crank_along: float = quantity("crank_along_m", 0.0, 10.0)
    crank_above: float = quantity("crank_above_m", -2.0, 3.0)
    crank_cylinder_arm: float = quantity("crank_cylinder_arm_m", 0.05, 5.0)  # to the cylinder's pin [m]
    crank_link_arm: float = quantity("crank_link_arm_m", 0.05, 5.0)  # to the link's pin [m]
    crank_angle: float = quantity(
        "crank_angle_deg", -360.0, 360.0
    )  # from the link's arm to the cylinder's, upwards [rad]
    link_length: float = quantity("link_length_m", 0.05, 5.0)
    # pin of the link on the bucket, from the bucket's own pin, as carried [m]
    bucket_pin_x: float = quantity("bucket_pin_x_m", -2.0, 2.0)
    bucket_pin_z: float = quantity("bucket_pin_z_m", -2.0, 2.0)
    back_pressure: float = quantity("back_pressure_Pa", 0.0, 5e6)
    relief_pressure: float = quantity("relief_pressure_Pa", 6e6, 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Wheel motors: what they can give at the wheel, and how fast."""

    front_peak_torque: float = quantity("front_peak_torque_N_m", 0.0, 1e6)  # of one wheel [N m]
    rear_peak_torque: float = quantity("rear_peak_torque_N_m", 0.0, 1e6)
    time_constant: float = quantity(
        "time_constant_s", 0.005, 5.0
    )  # of the torque behind the demanded torque [s]
    rate_limit: float = quantity("rate_limit_N_m_per_s", 1.0, 1e8)


@dataclass(frozen=True, slots=True, kw_only=True)
class Driveline:
    """How torque comes to the wheels: a motor at each, or one that drives both axles through a propeller shaft.

    With a shaft the axles' differentials are open: both wheels of an axle have the same torque, and the shaft
    makes the axles turn alike, but for its wind-up. Its values are seen at the wheels.
    """

    layout: str = choice(
        "layout", "motors", "shaft"
    )  # "shaft": stiffness and damping below; "motors" does not use them
    stiffness: float = quantity("shaft_stiffness_N_m_per_rad", 0.0, 1e7)
    damping: float = quantity("shaft_damping_N_m_s_per_rad", 0.0, 1e5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Brake:
    """Friction brake of one wheel."""

    capacity: float = quantity("capacity_N_m", 0.0, 1e6)  # friction torque that the brake can hold [N m]
    time_constant: float = quantity("time_constant_s", 0.005, 5.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tyre:
    """Tyre properties; the names of the coefficients are those of the Magic Formula."""

    radius: float = quantity("radius_m", 0.1, 3.0)  # unloaded [m]
    # pressures [bar]; the ppx, ppy and pfz1 multiply (pressure - nominal) / nominal
    front_pressure: float = quantity("front_pressure_bar", 0.5, 10.0)
    rear_pressure: float = quantity("rear_pressure_bar", 0.5, 10.0)
    nominal_pressure: float = quantity("nominal_pressure_bar", 0.5, 10.0)
    nominal_load: float = quantity("nominal_load_N", 100.0, 1e6)  # pkx2, pdx2: per (load / this - 1)
    # load = nominal_load (qfz1 d + qfz2 d²), d = deflection / radius, stiffer by 1 + pfz1 dp with pressure
    qfz1: float = quantity("qfz1", 0.1, 1e6)
    qfz2: float = quantity("qfz2", 0.0, 1e6)
    pfz1: float = quantity("pfz1", 0.0, 2.0)
    damping: float = quantity("damping_N_s_per_m", 0.0, 1e5)  # vertical [N s/m]
    nominal_friction: float = quantity("nominal_friction", 0.05, 2.0)  # of the ground of the curves
    # longitudinal curve: slip stiffness k, shape c, peak d, curvature e, pressure p
    pkx1: float = quantity("pkx1", 0.1, 60.0)
    pkx2: float = quantity("pkx2", -50.0, 50.0)
    pkx3: float = quantity("pkx3", -2.0, 2.0)
    pcx1: float = quantity("pcx1", 1.0, 3.0)
    pdx1: float = quantity("pdx1", 0.01, 3.0)
    pdx2: float = quantity("pdx2", -0.2, 0.2)
    pex1: float = quantity("pex1", -20.0, 1.0)
    pex2: float = quantity("pex2", -50.0, 50.0, default=0.0)
    pex3: float = quantity("pex3", -50.0, 50.0, default=0.0)
    pex4: float = quantity("pex4", -1.0, 1.0, default=0.0)
    ppx1: float = quantity("ppx1", -2.0, 2.0)
    ppx2: float = quantity("ppx2", -2.0, 2.0)
    ppx3: float = quantity("ppx3", -1.0, 1.0)
    ppx4: float = quantity("ppx4", -1.0, 1.0)
    # lateral curve, likewise
    pky1: float = quantity("pky1", 0.1, 100.0)
    pky2: float = quantity("pky2", 0.1, 20.0)
    pcy1: float = quantity("pcy1", 0.3, 3.0)
    pdy1: float = quantity("pdy1", 0.01, 3.0)
    pdy2: float = quantity("pdy2", -0.2, 0.2)
    pey1: float = quantity("pey1", -20.0, 1.0)
    pey2: float = quantity("pey2", -50.0, 50.0, default=0.0)
    ppy1: float = quantity("ppy1", -2.0, 2.0, default=0.0)
    ppy2: float = quantity("ppy2", -2.0, 2.0, default=0.0)
    ppy3: float = quantity("ppy3", -1.0, 1.0, default=0.0)
    ppy4: float = quantity("ppy4", -1.0, 1.0, default=0.0)
    # combined slip: how much lateral slip takes from the longitudinal force (x), and the reverse (y)
    rbx1: float = quantity("rbx1", 0.0, 100.0)
    rbx2: float = quantity("rbx2", -100.0, 100.0)
    rcx1: float = quantity("rcx1", 0.0, 1.0)
    rex1: float = quantity("rex1", -20.0, 1.0)
    rby1: float = quantity("rby1", 0.0, 100.0)
    rby2: float = quantity("rby2", -100.0, 100.0)
    rcy1: float = quantity("rcy1", 0.0, 1.0)
    # pneumatic trail, for the aligning moment
    qbz1: float = quantity("qbz1", 0.0, 100.0)
    qcz1: float = quantity("qcz1", 0.0, 3.0)
    qdz1: float = quantity("qdz1", 0.0, 1.0)
    qdz2: float = quantity("qdz2", -0.2, 0.2)
    # carcass: with the slip stiffness it gives the relaxation length; pcfx3 and pcfy3 are its changes with pressure
    longitudinal_stiffness: float = quantity("longitudinal_stiffness_N_per_m", 1e4, 1e8)
    lateral_stiffness: float = quantity("lateral_stiffness_N_per_m", 1e4, 1e8)
    pcfx3: float = quantity("pcfx3", -0.5, 2.0, default=0.0)
    pcfy3: float = quantity("pcfy3", -0.5, 2.0, default=0.0)
    # numerical floors: a shorter relaxation length, or no damping at standstill, makes the slip states stiff
    shortest_relaxation: float = quantity("shortest_relaxation_m", 0.02, 1.0)
    carcass_damping: float = quantity("carcass_damping_N_s_per_m", 0.0, 3e4)
    carcass_damping_speed: float = quantity("carcass_damping_speed_m_per_s", 0.05, 5.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """All parameters of one machine.

    family: the name that its equipment and the calibration of an ECU that fits it go by.
    """

    name: str
    family: str
    geometry: Geometry
    rear_frame: Body
    rear_axle: Body
    front_frame: Body
    front_axle: Body
    lift_arm: Body
    bucket: Body
    payload: Payload
    wheel: Wheel
    steering: Steering
    oscillation: Oscillation
    lift: Lift
    tilt: Tilt
    drive: Drive
    driveline: Driveline
    brake: Brake
    tyre: Tyre
    effects: tuple[ActiveEffect, ...] = ()

    @property
    def mass(self) -> float:
        """Mass without payload [kg]."""
        bodies = (
            self.rear_frame,
            self.rear_axle,
            self.front_frame,
            self.front_axle,
            self.lift_arm,
            self.bucket,
        )
        return sum(body.mass for body in bodies) + 4.0 * self.wheel.mass


_TABLES: dict[str, type[Any]] = {
    name: kind
    for name, kind in get_type_hints(Machine).items()
    if isinstance(kind, type) and is_dataclass(kind)
}


def load_machine(name_or_path: str | Path, changes: Sequence[Change] = ()) -> Machine:
    """A machine by name ("l60") or from a TOML file, `changes` laid over it.

    A file with a key `base` changes the machine of that name. Raises ConfigurationError, naming file,
    key, value, unit and range, if the file cannot be used.
    """
    top = _top(name_or_path, changes)
    name, family = top.text("name"), top.text("family")
    parts = {}
    for section, cls in _TABLES.items():
        if section not in top:
            raise top.error(section, "is missing")
        try:
            table = top.table(section)
            parts[section] = _read(cls, with_tir(table, changes) if section == "tyre" else table)
        except ConfigurationError:
            raise
        except ValueError as error:
            raise top.error(section, str(error)) from error
    chosen = _read_effects(top.table("effects"))
    top.finish()
    machine = Machine(name=name, family=family, effects=chosen, **parts)
    _check_order(machine, top)
    return machine


def family_of(name_or_path: str | Path, changes: Sequence[Change] = ()) -> str:
    """The family of a machine, without a look at the rest of it."""
    return _top(name_or_path, changes).text("family")


def _top(name_or_path: str | Path, changes: Sequence[Change]) -> CheckedTable:
    """The top table of a machine by name or path."""
    return CheckedTable.from_file(find_file(name_or_path, MACHINES, "machine"), changes, bases=MACHINES)


def _read_effects(table: CheckedTable) -> tuple[ActiveEffect, ...]:
    """The effects of the [effects.NAME] tables; parameters not given are typical."""
    names = list(table.keys())
    if not names:
        return ()
    known = effects()
    for name in names:
        if name not in known:
            raise table.unknown(name, known)
    return tuple(known[name].read(table.table(name)) for name in names)


def _check_order(machine: Machine, top: CheckedTable) -> None:
    """Refuse values that are possible each but not together."""
    for section, body in ((name, getattr(machine, name)) for name, cls in _TABLES.items() if cls is Body):
        if not body.rigid:
            raise top.error(
                section,
                f"inertias {body.ixx:g}, {body.iyy:g}, {body.izz:g} kg m2: one exceeds the sum of the others",
            )
    for section, part in (("lift", machine.lift), ("tilt", machine.tilt)):
        if not part.lower_limit <= part.carry_angle <= part.upper_limit:
            low, carry, high = (
                math.degrees(a) for a in (part.lower_limit, part.carry_angle, part.upper_limit)
            )
            raise top.error(
                f"{section}.carry_angle_deg",
                f"= {carry:g} deg is outside its own limits {low:g}..{high:g} deg",
            )
        if part.rod >= part.bore:
            raise top.error(
                f"{section}.rod_m", f"= {part.rod:g} m is not smaller than the bore, {part.bore:g} m"
            )
    for section, servo in (("steering", machine.steering), ("lift", machine.lift), ("tilt", machine.tilt)):
        if servo.cushion_time_constant < 4.0 * servo.time_constant:
            raise top.error(
                f"{section}.cushion_time_constant_s",
                f"= {servo.cushion_time_constant:g} s is below {4.0 * servo.time_constant:g} s, four times "
                "time_constant_s: the cylinder would overshoot its end stop",
            )
