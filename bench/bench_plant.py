"""Plant step against MuJoCo stepping the same bodies under the same compiled tyre forces, in one run.

    python -m bench.bench_plant [--seconds 10] [--repeats 9]

Both drive the laden machine at 3 m/s. In MuJoCo the three cylinder-driven joints are held by its own
velocity actuators; its tyres are one compiled call per step. Medians over the repeats, interleaved so
that a busy machine hits both alike.
"""

import argparse
import platform
import statistics
import time
from collections.abc import Callable

import mujoco
import numba
import numpy as np

from plant import state as s
from plant.machine import Machine, load_machine
from plant.parameters import P_FRICTION, P_NORMAL, P_WHEELS, WHEEL_SIZE
from plant.plant import Commands, Plant
from plant.tyre import wheel_contact
from tests.plant.oracle.loader import MujocoLoader, mjcf

PAYLOAD = 3204.0
COMMANDS = Commands(wheel_torque=(500.0,) * 4)
ACTUATORS = "".join(f'<velocity joint="{name}" kv="1e9"/>' for name in ("articulation", "lift", "tilt"))


@numba.njit
def tyres_in_mujoco(xpos, xmat, cvel, com, p, slips, step, out, xfrc):
    """Tyre wrenches of the four wheels at MuJoCo's state, onto its bodies."""
    normal = p[P_NORMAL : P_NORMAL + 3]
    motion = np.empty(6)
    for i in range(4):
        c, a = xpos[i], xmat[i].reshape(3, 3)[:, 1].copy()
        w, v = cvel[i, :3], cvel[i, 3:]
        motion[:3] = w
        motion[3] = v[0] - w[1] * com[2] + w[2] * com[1]
        motion[4] = v[1] - w[2] * com[0] + w[0] * com[2]
        motion[5] = v[2] - w[0] * com[1] + w[1] * com[0]
        height = normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2]
        block = p[P_WHEELS + i * WHEEL_SIZE : P_WHEELS + (i + 1) * WHEEL_SIZE]
        wheel_contact(
            block, p[P_FRICTION], 0.0, c, height, a, normal, motion, slips[0, i], slips[1, i], step, out[i]
        )
        slips[0, i] += step * out[i, s.T_KAPPA_RATE]
        slips[1, i] += step * out[i, s.T_TAN_ALPHA_RATE]
        f, m = out[i, s.T_WRENCH + 3 : s.T_WRENCH + 6], out[i, s.T_WRENCH : s.T_WRENCH + 3]
        xfrc[i, :3] = f
        xfrc[i, 3] = m[0] - c[1] * f[2] + c[2] * f[1]
        xfrc[i, 4] = m[1] - c[2] * f[0] + c[0] * f[2]
        xfrc[i, 5] = m[2] - c[0] * f[1] + c[1] * f[0]


def mujoco_stepper(machine: Machine, plant: Plant) -> Callable[[int], float]:
    """A function that advances MuJoCo by n steps; returns the speed reached [m/s]."""
    text = mjcf(machine, PAYLOAD, plant.step_s).replace(
        "<sensor>", f"<actuator>{ACTUATORS}</actuator><sensor>"
    )
    model = mujoco.MjModel.from_xml_string(text.replace('integrator="Euler"', 'integrator="implicitfast"'))
    start = MujocoLoader(machine, plant._parameters, payload_mass=PAYLOAD)
    start.set_state(plant._state)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start.data.qpos, start.data.qvel
    wheels = [model.body(name).id for name in ("fl", "fr", "rl", "rr")]
    orders = {name: slice(at, at + 2) for name, at in (("front", wheels[0]), ("rear", wheels[2]))}
    assert wheels[1] == wheels[0] + 1
    assert wheels[3] == wheels[2] + 1
    for name in ("fl", "fr", "rl", "rr"):
        data.qfrc_applied[model.joint(f"spin_{name}").dofadr[0]] = 500.0
    p, slips, out, xfrc = plant._parameters, np.zeros((2, 4)), np.zeros((4, s.T_OUTPUTS)), np.zeros((4, 6))
    xpos, xmat, cvel = np.empty((4, 3)), np.empty((4, 9)), np.empty((4, 6))
    front, rear = orders["front"], orders["rear"]
    root = model.body("rear_frame").id

    def run(steps: int) -> float:
        for _ in range(steps):
            mujoco.mj_step1(model, data)
            for target, source in ((xpos, data.xpos), (xmat, data.xmat), (cvel, data.cvel)):
                target[:2], target[2:] = source[front], source[rear]
            tyres_in_mujoco(xpos, xmat, cvel, data.subtree_com[root], p, slips, plant.step_s, out, xfrc)
            data.xfrc_applied[front], data.xfrc_applied[rear] = xfrc[:2], xfrc[2:]
            mujoco.mj_step2(model, data)
        return float(np.hypot(*data.qvel[:2]))

    return run


def bare_stepper(machine: Machine, plant: Plant) -> Callable[[int], None]:
    """MuJoCo's rigid bodies alone, no tyres, looped in C: a floor for any force model on top of it."""
    model = mujoco.MjModel.from_xml_string(mjcf(machine, PAYLOAD, plant.step_s))
    data = mujoco.MjData(model)
    data.qpos[2] = 1000.0
    return lambda steps: mujoco.mj_step(model, data, steps)


def timed(run: Callable[[], object], steps: int) -> float:
    """Microseconds per step."""
    start = time.perf_counter()
    run()
    return (time.perf_counter() - start) / steps * 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated time of one repeat")
    parser.add_argument("--repeats", type=int, default=9)
    args = parser.parse_args()
    steps = round(args.seconds / 1e-3)
    machine = load_machine("l60")
    plants = {
        kind: Plant(machine, payload_mass=PAYLOAD, speed=3.0, integrator=kind)
        for kind in ("semi-implicit", "rk4")
    }
    ticking = Plant(machine, payload_mass=PAYLOAD, speed=3.0)
    peer = mujoco_stepper(machine, plants["semi-implicit"])
    bare = bare_stepper(machine, plants["semi-implicit"])

    def tick() -> None:
        for _ in range(steps // 10):
            ticking.advance(COMMANDS, 0.01)
            ticking.truth()

    rows: dict[str, Callable[[], object]] = {
        "plant, semi-implicit": lambda: plants["semi-implicit"].advance(COMMANDS, args.seconds),
        "plant, rk4": lambda: plants["rk4"].advance(COMMANDS, args.seconds),
        "plant, 10 ms at a time with truth": tick,
        "MuJoCo bodies, compiled tyres, stepped from Python": lambda: peer(steps),
        "MuJoCo bodies alone, no tyres, looped in C": lambda: bare(steps),
    }
    for run in rows.values():
        run()  # compile and warm up
    samples: dict[str, list[float]] = {name: [] for name in rows}
    for _ in range(args.repeats):
        for name, run in rows.items():
            samples[name].append(timed(run, steps))
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, numba {numba.__version__}, "
        f"MuJoCo {mujoco.__version__}; {args.repeats} repeats of {steps} steps of 1 ms"
    )
    print(f"{'':52s} {'us/step':>8s} {'min..max':>14s} {'x real time':>12s} {'ratio':>6s}")
    base = statistics.median(samples["plant, semi-implicit"])
    for name, values in samples.items():
        median = statistics.median(values)
        print(
            f"{name:52s} {median:8.2f} {min(values):6.2f}..{max(values):6.2f} {1000.0 / median:12.0f} {median / base:6.2f}"
        )


if __name__ == "__main__":
    main()
