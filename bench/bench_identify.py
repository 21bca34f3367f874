"""The fit of a rig's log against the same fit written plainly: scipy's trust region on all rows, derivatives by differences.

Both begin at the same place, with the same noise and the same gains of the predictor, and use the same compiled simulation; costs have to
agree to a thousandth.
"""

import time

import numpy as np
from scipy.optimize import least_squares

from discrepancy.estimation.autoregression import Whitener
from identify.make.rig import Plan, make_rig
from identify.rig.chain import first_stage, prepare, problem_of
from identify.tyre.estimate import Noise, estimate
from plant.sheets.machine import load_machine

NEEDED = 10.0


def main() -> None:
    """Print both times and costs; fails below the needed ratio."""
    log, _ = make_rig(load_machine("l60"), 1, None, Plan(inflation_bar=(), repeats=1, validation=False))
    ready = prepare(log)
    start = first_stage(ready)
    problem = problem_of(ready).held_at(start)
    sizes = [t.force_sd for t in problem.traces]
    # white noise of known size: the peer has no model of coloured noise, and costs must be comparable
    noise = Noise(
        [Whitener(np.zeros((0, 1, 1)), np.array([[1.0 / s]])) for s in sizes],
        [t.kept.astype(float) for t in problem.traces],
    )
    estimate(problem, start, noise=noise)  # compiled by now
    began = time.process_time()
    ours = estimate(problem, start, noise=noise)
    ours_s = time.process_time() - began
    unknowns = problem.unknowns

    def residual(x: np.ndarray) -> np.ndarray:
        values = {u.name: float(v) for u, v in zip(unknowns, x, strict=True)}
        rows = [
            np.where(p.kept, p.residual / s, 0.0) for p, s in zip(problem.parts(values), sizes, strict=True)
        ]
        rows.append(np.array([(values[u.name] - u.prior) / u.prior_sd for u in unknowns if u.prior_sd]))
        return np.concatenate(rows)

    low, high = np.array([u.lower for u in unknowns]), np.array([u.upper for u in unknowns])
    # scipy's trust region needs a start inside its bounds, not on them
    x = np.clip(
        [start.get(u.name, u.start) for u in unknowns], low + 1e-9 * (high - low), high - 1e-9 * (high - low)
    )
    began = time.process_time()
    plain = least_squares(
        residual,
        x,
        bounds=(low, high),
        x_scale=[u.typical for u in unknowns],
        xtol=1e-7,
        ftol=1e-9,
        gtol=1e-12,
        max_nfev=60,
    )
    plain_s = time.process_time() - began
    # the same function for both, so that the costs can be compared
    cost = float(np.sum(residual(np.array([ours.values[u.name] for u in unknowns])) ** 2))
    print(f"{len(problem.traces)} runs, {len(unknowns)} unknowns, {plain.fun.size} rows")
    print(
        f"plain scipy, differences: {plain_s:.2f} s of processor, {plain.nfev} steps, cost {2.0 * plain.cost:.3f}"
    )
    print(f"loaderhil identify:       {ours_s:.2f} s of processor, {ours.evaluations} steps, cost {cost:.3f}")
    print(f"ratio {plain_s / ours_s:.1f}, needed {NEEDED:g}")
    if plain_s / ours_s < NEEDED or abs(cost / (2.0 * plain.cost) - 1.0) > 1e-3:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
