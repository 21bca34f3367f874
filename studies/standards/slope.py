"""Slopes: holding with the brakes, tilt table, and driving across side slopes at 16 km/h."""

import math

import numpy as np

from plant.physics.equilibrium import NoEquilibriumError
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.unit.actuators import Four
from studies.standards.check import Array, Bound, Candidate, Chart, Check, Clause, Findings, Line, Standard
from studies.standards.course import drive, straight
from studies.standards.rest import lift_off_slope
from studies.standards.stopping import KMH, full_brakes

SLOPE_DEG = 30.0
SERVICE_PERCENT = 25.0  # grade for the service brakes
HOLD_S = 10.0
CREEP_M = 0.05  # permitted in HOLD_S: the tyres settle under the brakes
ACROSS_KMH = 16.0
ACROSS_M = 60.0
STEEPEST_DEG = 45.0  # upper end of the bisection
RESOLUTION_DEG = 0.25  # its accuracy

SERVICE = Clause(
    source="ISO 3450", detail=f"2011 edition, service brakes on {SERVICE_PERCENT:.0f} %", verified=False
)
BENCH = Clause(
    source="this bench",
    detail="30° is the slope of ISO 3471's roll-over; it must not begin by itself",
    verified=True,
)


def creep(candidate: Candidate, grade: float, payload: float, brakes: Four) -> float:
    """Distance [m] that the braked machine moves in HOLD_S on a grade [rad], nose uphill positive; infinite without an equilibrium."""
    try:
        plant = Plant(candidate.machine, Surface(grade=grade), payload_mass=payload)
    except NoEquilibriumError:
        # without an equilibrium the machine tips: no distance describes that, and every bound is exceeded
        return math.inf
    start = plant.truth().position.copy()
    plant.advance(Commands(brake_torque=brakes), HOLD_S)
    return float(np.linalg.norm(plant.truth().position - start))


def across(candidate: Candidate, payload: float, bank_deg: float) -> tuple[Array, Array]:
    """Distance driven [m] and smallest wheel load over that on level ground, from standstill straight across a side slope."""
    # over the load of each wheel on level ground: wheels of one machine carry different loads
    level = Plant(candidate.machine, payload_mass=payload).truth().normal_force
    plant = Plant(candidate.machine, Surface(bank=math.radians(bank_deg)), payload_mass=payload)
    done = drive(plant, straight(ACROSS_M), ACROSS_KMH * KMH)
    return done.path[:, 0], (done.load / level).min(axis=1)


def steepest_crossing(candidate: Candidate, payload: float) -> float:
    """The steepest side slope [deg] that the machine crosses with all wheels on the ground, by bisection."""
    low, high = 0.0, STEEPEST_DEG
    # bisection: whether it crosses is yes or no, and gives a secant nothing to go by
    while high - low > RESOLUTION_DEG:
        middle = (low + high) / 2.0
        try:
            crossed = across(candidate, payload, middle)[1].min() > 0.0
        except NoEquilibriumError:
            crossed = False
        low, high = (middle, high) if crossed else (low, middle)
    return low


def perform(candidate: Candidate) -> Findings:
    """Brakes, tilt table, then the drive."""
    loads = {"empty": 0.0, f"{candidate.rated_payload:.0f} kg carried": candidate.rated_payload}
    checks = _holding(candidate, loads) + _tilt_table(candidate, loads)
    lines = []
    for name, payload in loads.items():
        steepest = steepest_crossing(candidate, payload)
        lines.append(Line(f"{name}, {steepest:.1f}°", *across(candidate, payload, steepest)))
        what = f"steepest side slope crossed at {ACROSS_KMH:.0f} km/h, {name}"
        checks.append(Check(what=what, unit="°", measured=steepest))
    chart = Chart(
        title=f"Across the steepest side slope at {ACROSS_KMH:.0f} km/h",
        x="distance [m]",
        y="smallest wheel load, share of level",
        lines=tuple(lines),
    )
    return Findings(checks=tuple(checks), charts=(chart,))


def _holding(candidate: Candidate, loads: dict[str, float]) -> list[Check]:
    steep, capacity = math.radians(SLOPE_DEG), candidate.machine.brake.capacity
    cases = (
        (math.atan(SERVICE_PERCENT / 100.0), full_brakes(candidate), SERVICE, "service brakes"),
        (steep, (capacity,) * 4, BENCH, "all brakes locked"),
    )
    return [
        Check(
            what=f"creep in {HOLD_S:.0f} s, {math.degrees(grade):.0f}° nose {way}hill, {brakes}, {name}",
            unit="m",
            measured=creep(candidate, sign * grade, payload, torque),
            bound=Bound("at most", CREEP_M, clause),
        )
        for grade, torque, clause, brakes in cases
        for name, payload in loads.items()
        for way, sign in (("up", 1.0), ("down", -1.0))
    ]


def _tilt_table(candidate: Candidate, loads: dict[str, float]) -> list[Check]:
    """Straight against the demand; fully articulated for information, the outside of the turn downhill and uphill."""
    lock = candidate.machine.steering.limit
    checks = []
    for name, payload in loads.items():
        for pose, delta, side, bound in (
            ("straight", 0.0, 1, Bound("at least", SLOPE_DEG, BENCH)),
            ("full left, left side uphill", lock, 1, None),
            ("full left, right side uphill", lock, -1, None),
        ):
            slope = lift_off_slope(candidate.machine, delta, payload, None, side)
            checks.append(
                Check(
                    what=f"tilt at which a wheel lifts, {pose}, {name}",
                    unit="°",
                    measured=math.degrees(math.atan(slope)),
                    bound=bound,
                )
            )
    return checks


STANDARD = Standard(
    name="slope",
    title="30° slope: holding, tilting, driving across",
    method=(
        "The braked machine stands nose up and nose down on a grade for ten seconds; on a tilt table that does not let it slide the bank grows "
        "until a wheel carries nothing. A driver takes it from standstill to 16 km/h straight across side slopes of dry asphalt; the steepest one "
        "on which every wheel keeps the ground informs, as do the articulated poses."
    ),
    perform=perform,
)
