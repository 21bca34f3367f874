"""Tipping load and rated operating capacity after ISO 14397-1."""

import math

import numpy as np

from plant.sheets.machine import Machine
from studies.standards.check import Bound, Candidate, Chart, Check, Clause, Findings, Line, Standard
from studies.standards.rest import rear_load, rigid, tipping_load

RATED_SHARE = 0.5  # rated operating capacity over tipping load
DEFINITION = Clause(
    source="ISO 14397-1",
    detail="3.1 and 3.2 of the 2007 edition: least stable position, hard level ground, largest reach; half of it on firm ground",
    verified=True,
)
POINTS = 9  # of each line of the chart


def perform(candidate: Candidate) -> Findings:
    """Straight and fully articulated, on rigid and on flexible tyres."""
    machine, lock = candidate.machine, candidate.machine.steering.limit
    tyres = {"rigid": rigid(machine), "flexible": machine}
    found = {(name, angle): tipping_load(on, angle) for name, on in tyres.items() for angle in (0.0, lock)}
    checks = [
        Check(
            what=f"tipping load, {name} tyres, {math.degrees(angle):.0f}° articulated",
            unit="kg",
            measured=load,
        )
        for (name, angle), load in found.items()
    ]
    checks += [
        Check(
            what=f"rated operating capacity, {name} tyres",
            unit="kg",
            measured=RATED_SHARE * min(found[name, 0.0], found[name, lock]),
            bound=Bound("at least", candidate.rated_payload, DEFINITION),
        )
        for name in tyres
    ]
    return Findings(checks=tuple(checks), charts=(_chart(candidate, tyres, found),))


def _chart(candidate: Candidate, tyres: dict[str, Machine], found: dict[tuple[str, float], float]) -> Chart:
    lines = []
    for (name, angle), tips in found.items():
        # not to the tipping load itself: there the machine has no equilibrium
        loads = np.linspace(0.0, 0.98 * tips, POINTS)
        forces = [float(rear_load(tyres[name], angle, load)[0]) / 1e3 for load in loads]
        label = f"{name} tyres, {math.degrees(angle):.0f}°"
        lines.append(Line(label, np.append(loads, tips), np.append(forces, 0.0)))
    rated = candidate.rated_payload
    lines.append(
        Line(
            "rated payload",
            np.array((rated, rated)),
            np.array((0.0, max(float(line.y[0]) for line in lines))),
            dashed=True,
        )
    )
    return Chart(
        title="Load on the rear wheels, arm level",
        x="payload [kg]",
        y="both rear wheels [kN]",
        lines=tuple(lines),
    )


STANDARD = Standard(
    name="tipping",
    title="ISO 14397-1: tipping load and rated operating capacity",
    method=(
        "The machine stands on level ground, arm level and bucket rolled back as carried, and the payload grows until the rear "
        "wheels carry nothing: straight and at full articulation, on tyres that do not give way and on the machine's own. The rated operating "
        "capacity is half of the smaller."
    ),
    perform=perform,
)
