"""The plant's tyre against peers, per evaluation, with the same coefficients in the same run.

    python -m bench.bench_tyre [--count 20000] [--repeats 9] [--tir FILE ...]

Peers: CommonRoad vehicle models' PAC2002 functions (commonroad-vehicle-models, BSD-3) as shipped, and the same functions compiled
by numba, which is the fair peer; they know no load dependence and are asked at the nominal load. Floor: the published formula written for
whole arrays in numpy (tests/plant/oracle/magic_formula.py), at any load. Differences are over the load. Without --tir, the machine's own tyre.
"""

import argparse
import platform
import statistics
import time
from collections import namedtuple
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
from numba.extending import register_jitable
from vehiclemodels.utils import tire_model

from plant.physics.parameters import P_WHEELS, WHEEL_SIZE, parameter_vector
from plant.physics.surface import Surface
from plant.physics.tyre import combined_forces, stiffness_and_peak
from plant.sheets.machine import Machine, load_machine
from plant.sheets.tyre_file import lacking, read_tir, tyre_values
from tests.plant.oracle import magic_formula

NAMES = (
    "p_cx1 p_dx1 p_dx3 p_ex1 p_kx1 p_hx1 p_vx1 r_bx1 r_bx2 r_cx1 r_ex1 r_hx1 p_cy1 p_dy1 p_dy3 p_ey1 p_ky1 p_hy1 p_hy3 "
    "p_vy1 p_vy3 r_by1 r_by2 r_by3 r_cy1 r_ey1 r_hy1 r_vy1 r_vy3 r_vy4 r_vy5 r_vy6"
)
Peer = namedtuple("Peer", NAMES)
register_jitable(tire_model.sign)

LONGITUDINAL, LATERAL, LONGITUDINAL_COMBINED, LATERAL_COMBINED = (
    numba.njit(function)
    for function in (
        tire_model.formula_longitudinal,
        tire_model.formula_lateral,
        tire_model.formula_longitudinal_comb,
        tire_model.formula_lateral_comb,
    )
)


@numba.njit
def ours(w, loads, kappa, slip, out):
    """The plant's tyre, combined forces."""
    for i in range(kappa.size):
        curve = stiffness_and_peak(w, 1.0, loads[i])
        along, across, _ = combined_forces(w, loads[i], curve, kappa[i], slip[i])
        out[i, 0], out[i, 1] = along, across


def peer_loop(longitudinal, lateral, longitudinal_combined, lateral_combined):
    """A loop over the peer's functions; its longitudinal slip has the other sign."""

    def loop(p, loads, kappa, slip, out):
        for i in range(kappa.size):
            # in its pure formula only; the combined one takes ours
            pure_x = longitudinal(-kappa[i], 0.0, loads[i], p)
            pure = lateral(slip[i], 0.0, loads[i], p)
            out[i, 0] = longitudinal_combined(kappa[i], slip[i], pure_x, p)
            out[i, 1] = lateral_combined(kappa[i], slip[i], 0.0, pure[1], loads[i], pure[0], p)

    return loop


def coefficients(machine: Machine) -> dict[str, float]:
    """The machine's tyre by the names of the Magic Formula."""
    tyre = machine.tyre
    return {name: getattr(tyre, name.lower()) for name in magic_formula.NAMES} | {"FNOMIN": tyre.nominal_load}


def peer_of(c: dict[str, float]) -> Peer:
    """The peer's parameters for the nominal load."""
    # the peer has one cornering stiffness, ours one that depends on load: both at the nominal load
    stiffness = c["PKY1"] * np.sin(2.0 * np.arctan(1.0 / c["PKY2"]))
    values = dict.fromkeys(NAMES.split(), 0.0)
    values |= {
        name: float(c[name.replace("_", "").upper()])
        for name in ("p_cx1", "p_dx1", "p_ex1", "p_kx1", "r_bx1", "r_bx2", "r_cx1", "r_ex1", "p_cy1", "p_dy1", "p_ey1", "r_by1", "r_by2", "r_cy1")
    }  # fmt: skip
    return Peer(**(values | {"p_ky1": float(stiffness)}))


def nanoseconds(work: Callable[[], object], count: int, repeats: int) -> tuple[float, float]:
    """Median and spread (half the range between the quartiles) per evaluation."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter_ns()
        work()
        times.append((time.perf_counter_ns() - begin) / count)
    # quartiles and not the range: one repeat in nine is usually disturbed
    quarter, median, third = statistics.quantiles(times, n=4)
    return median, (third - quarter) / 2.0


def rows(name: str, machine: Machine, count: int, repeats: int) -> list[str]:
    """One tyre's rows of the table."""
    vector = parameter_vector(machine, Surface(friction=machine.tyre.nominal_friction), 0.0)
    w, c = vector[P_WHEELS : P_WHEELS + WHEEL_SIZE], coefficients(machine)
    dpi = machine.tyre.front_pressure / machine.tyre.nominal_pressure - 1.0
    rng = np.random.default_rng(1)
    # beyond the peak on both sides, where formulas branch
    kappa, slip = rng.uniform(-1.2, 1.2, count), rng.uniform(-0.5, 0.5, count)
    nominal = np.full(count, machine.tyre.nominal_load)
    loads = nominal * rng.uniform(0.3, 1.8, count)
    out, theirs = np.empty((count, 2)), np.empty((count, 2))
    median, spread = nanoseconds(lambda: ours(w, loads, kappa, slip, out), count, repeats)
    lines = [f"| {name} | plant, compiled | {median:.1f} ± {spread:.1f} | 1 | |"]

    def compare(what: str, work: Callable[[], object], asked: np.ndarray, evaluations: int) -> None:
        took, around = nanoseconds(work, evaluations, repeats)
        ours(w, asked, kappa, slip, out)
        worst = np.abs(out - theirs)[:evaluations].max() / machine.tyre.nominal_load
        lines.append(f"| | {what} | {took:.1f} ± {around:.1f} | {took / median:.1f} | {worst:.1e} |")

    def whole() -> None:
        theirs[:] = np.column_stack(magic_formula.forces(c, loads, kappa, slip, dpi))

    compare("numpy, whole arrays", whole, loads, count)
    # the peer knows no inflation pressure
    if dpi == 0.0:
        peer = peer_of(c)
        plain = peer_loop(
            tire_model.formula_longitudinal,
            tire_model.formula_lateral,
            tire_model.formula_longitudinal_comb,
            tire_model.formula_lateral_comb,
        )
        compiled = numba.njit(peer_loop(LONGITUDINAL, LATERAL, LONGITUDINAL_COMBINED, LATERAL_COMBINED))
        # pure Python is slower by orders of magnitude
        few = max(count // 20, 1)
        compare("CommonRoad, compiled", lambda: compiled(peer, nominal, kappa, slip, theirs), nominal, count)
        compare(
            "CommonRoad, as shipped",
            lambda: plain(peer, nominal[:few], kappa[:few], slip[:few], theirs),
            nominal,
            few,
        )
    return lines


def on_file(base: Machine, path: Path) -> Machine:
    """The machine on the tyre of a file, without what the plant's tyre lacks, at its nominal pressure."""
    file = read_tir(path)
    values = tyre_values(file, list(lacking(file)))
    names = {"radius_m": "radius", "nominal_load_N": "nominal_load", "damping_N_s_per_m": "damping"}
    tyre = replace(base.tyre, **{names.get(key, key): value for key, value in values.items()})
    return replace(base, tyre=replace(tyre, front_pressure=tyre.nominal_pressure))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--tir", type=Path, nargs="*", default=[])
    asked = parser.parse_args()
    machine = load_machine("l60")
    tyres = {"l60": machine} | {path.stem: on_file(machine, path) for path in asked.tir}
    print(
        f"Python {platform.python_version()}, numba {numba.__version__}; {asked.count} random slips and loads, "
    )
    print(f"{asked.repeats} repeats, seed 1; longitudinal and lateral force in combined slip.\n")
    print(
        "| tyre | evaluated by | ns per evaluation | over the plant's | greatest difference / nominal load |"
    )
    print("|---|---|---:|---:|---:|")
    for name, given in tyres.items():
        print("\n".join(rows(name, given, asked.count, asked.repeats)))


if __name__ == "__main__":
    main()
