"""Plant step against MuJoCo stepping the same bodies under the same compiled tyre forces, in one run.

    python -m bench.bench_plant [--seconds 10] [--repeats 9]

Both drive the loaded machine at 3 m/s. In MuJoCo the three cylinder-driven joints are held by its own
velocity actuators; its tyres are one compiled call per step. Two ways to step it: from Python, step by step,
and in MuJoCo's own loop in C, which calls the compiled tyres back without Python in between (the fair peer).
Medians over the repeats, interleaved so that a busy machine hits all alike.
"""

import argparse
import platform
import statistics
import time
from collections.abc import Callable

import mujoco
import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from plant.physics import state as s
from plant.physics.parameters import P_FRICTION, P_NORMAL, P_WHEELS, WHEEL_SIZE
from plant.physics.tyre import wheel_contact
from plant.plant import Commands, Plant
from plant.sheets.machine import Machine, load_machine
from tests.plant.oracle.loader import MujocoLoader, mjcf

# Of the drive case `loaded`.
PAYLOAD = 3204.0
COMMANDS = Commands(wheel_torque=(500.0,) * 4)
# kv: stiff enough that the joints stand still, as our cylinders do
ACTUATORS = "".join(f'<velocity joint="{name}" kv="1e9"/>' for name in ("articulation", "lift", "tilt"))


@numba.njit
def tyres_in_mujoco(wheels, xpos, xmat, cvel, com, p, slips, step, out, xfrc):
    """Tyre wrenches of the four wheels (body numbers) at MuJoCo's state, onto its bodies."""
    normal = p[P_NORMAL : P_NORMAL + 3]
    motion = np.empty(6)
    for i in range(4):
        body = wheels[i]
        # wheel centre, and axle along the wheel's y
        c, a = xpos[body], xmat[body].reshape(3, 3)[:, 1].copy()
        w, v = cvel[body, :3], cvel[body, 3:]
        motion[:3] = w
        # MuJoCo's cvel is at the centre of mass of the whole tree; ours is at the origin of the world
        motion[3] = v[0] - w[1] * com[2] + w[2] * com[1]
        motion[4] = v[1] - w[2] * com[0] + w[0] * com[2]
        motion[5] = v[2] - w[0] * com[1] + w[1] * com[0]
        height = normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2]
        block = p[P_WHEELS + i * WHEEL_SIZE : P_WHEELS + (i + 1) * WHEEL_SIZE]
        wheel_contact(
            block, p[P_FRICTION], 0.0, c, height, a, normal, motion, slips[0, i], slips[1, i], step, out[i]
        )
        # relaxation of the tyre: MuJoCo has no states of ours, so they are integrated here
        slips[0, i] += step * out[i, s.T_KAPPA_RATE]
        slips[1, i] += step * out[i, s.T_TAN_ALPHA_RATE]
        f, m = out[i, s.T_WRENCH + 3 : s.T_WRENCH + 6], out[i, s.T_WRENCH : s.T_WRENCH + 3]
        xfrc[body, :3] = f
        # from the origin of the world to the wheel's centre, where MuJoCo applies it
        xfrc[body, 3] = m[0] - c[1] * f[2] + c[2] * f[1]
        xfrc[body, 4] = m[1] - c[2] * f[0] + c[0] * f[2]
        xfrc[body, 5] = m[2] - c[0] * f[1] + c[1] * f[0]


@intrinsic
def at_address(typing_context, address):
    """An integer as a pointer: where MuJoCo's arrays lie is known before the callback is compiled."""

    def code(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), code


class InMujoco:
    """MuJoCo's model of the machine on our tyres, set to the state of `plant`."""

    def __init__(self, machine: Machine, plant: Plant) -> None:
        text = mjcf(machine, PAYLOAD, plant.step_s).replace(
            "<sensor>", f"<actuator>{ACTUATORS}</actuator><sensor>"
        )
        # implicitfast: explicit Euler at 1 ms is not stable with actuators that stiff
        text = text.replace('integrator="Euler"', 'integrator="implicitfast"')
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        start = MujocoLoader(machine, plant._parameters, payload_mass=PAYLOAD)
        start.set_state(plant._state)
        self.data.qpos[:], self.data.qvel[:] = start.data.qpos, start.data.qvel
        for name in ("fl", "fr", "rl", "rr"):
            self.data.qfrc_applied[self.model.joint(f"spin_{name}").dofadr[0]] = 500.0
        root = self.model.body("rear_frame").id
        d = self.data
        self.arrays = (
            np.array([self.model.body(name).id for name in ("fl", "fr", "rl", "rr")]),
            d.xpos, d.xmat, d.cvel, d.subtree_com[root],
            plant._parameters, np.zeros((2, 4)), plant.step_s, np.zeros((4, s.T_OUTPUTS)), d.xfrc_applied,
        )  # fmt: skip

    def step_from_python(self, steps: int) -> None:
        """Every step, and the tyres in its middle, called from Python."""
        model, data, arrays = self.model, self.data, self.arrays
        for _ in range(steps):
            # positions and velocities first, then the forces that depend on them, then the step
            mujoco.mj_step1(model, data)
            tyres_in_mujoco(*arrays)
            mujoco.mj_step2(model, data)

    def callback(self):
        """The tyres as a C function that MuJoCo calls in the middle of its step."""
        step = self.arrays[7]
        places = [(array.ctypes.data, array.shape) for array in self.arrays if isinstance(array, np.ndarray)]
        (
            (a_wheels, n_wheels), (a_xpos, n_xpos), (a_xmat, n_xmat), (a_cvel, n_cvel), (a_com, n_com),
            (a_p, n_p), (a_slips, n_slips), (a_out, n_out), (a_xfrc, n_xfrc),
        ) = places  # fmt: skip

        @numba.cfunc(types.void(types.voidptr, types.voidptr))
        def tyres(model, data):
            tyres_in_mujoco(
                numba.carray(at_address(a_wheels), n_wheels, np.int64),
                numba.carray(at_address(a_xpos), n_xpos, np.float64),
                numba.carray(at_address(a_xmat), n_xmat, np.float64),
                numba.carray(at_address(a_cvel), n_cvel, np.float64),
                numba.carray(at_address(a_com), n_com, np.float64),
                numba.carray(at_address(a_p), n_p, np.float64),
                numba.carray(at_address(a_slips), n_slips, np.float64),
                step,
                numba.carray(at_address(a_out), n_out, np.float64),
                numba.carray(at_address(a_xfrc), n_xfrc, np.float64),
            )

        return tyres

    def speed(self) -> float:
        """Of the articulation joint [m/s]."""
        return float(np.hypot(*self.data.qvel[:2]))


def looped_in_c(machine: InMujoco) -> Callable[[int], None]:
    """A function that steps `machine` in MuJoCo's own loop."""
    tyres = machine.callback()

    def run(steps: int) -> None:
        mujoco.set_mjcb_control(tyres.ctypes)
        try:
            mujoco.mj_step(machine.model, machine.data, steps)
        finally:
            # the callback is global: left in place it would drive the next model on our tyres
            mujoco.set_mjcb_control(None)

    return run


def check_agreement(machine: Machine, plant: Plant) -> None:
    """Both ways to step MuJoCo are the same motion, and within a percent of ours after a second."""
    one, other, ours = InMujoco(machine, plant), InMujoco(machine, plant), plant.copy()
    one.step_from_python(1000)
    looped_in_c(other)(1000)
    ours.advance(COMMANDS, 1.0)
    # bit for bit: both call the same compiled tyres on the same arrays
    assert np.array_equal(one.data.qpos, other.data.qpos), "the callback is another machine"
    speed = float(np.hypot(*ours.truth().velocity[:2]))
    assert abs(one.speed() - speed) < 0.01 * speed, f"MuJoCo {one.speed()} m/s, ours {speed} m/s"


def bare_stepper(machine: Machine, plant: Plant) -> Callable[[int], None]:
    """MuJoCo's rigid bodies alone, no tyres, looped in C: a floor for any force model on top of it."""
    model = mujoco.MjModel.from_xml_string(mjcf(machine, PAYLOAD, plant.step_s))
    data = mujoco.MjData(model)
    # in free fall: without tyres nothing else holds the bodies up, and no contact is computed
    data.qpos[2] = 1000.0
    return lambda steps: mujoco.mj_step(model, data, steps)


def timed(run: Callable[[], object], steps: int) -> float:
    """Microseconds of processor time per step: nothing here waits, and a busy machine then counts less."""
    start = time.thread_time()
    run()
    return (time.thread_time() - start) / steps * 1e6


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
    check_agreement(machine, ticking)
    from_python = InMujoco(machine, ticking)
    in_c = looped_in_c(InMujoco(machine, ticking))
    bare = bare_stepper(machine, ticking)

    def tick() -> None:
        # as the plant's process does it: a tick of 10 ms, and its truth
        for _ in range(steps // 10):
            ticking.advance(COMMANDS, 0.01)
            ticking.truth()

    rows: dict[str, Callable[[], object]] = {
        "plant, semi-implicit": lambda: plants["semi-implicit"].advance(COMMANDS, args.seconds),
        "plant, rk4": lambda: plants["rk4"].advance(COMMANDS, args.seconds),
        "plant, 10 ms at a time with truth": tick,
        "MuJoCo, compiled tyres, looped in C": lambda: in_c(steps),
        "MuJoCo, compiled tyres, stepped from Python": lambda: from_python.step_from_python(steps),
        "MuJoCo, no tyres, looped in C": lambda: bare(steps),
    }
    for run in rows.values():
        run()  # compile and warm up
    samples: dict[str, list[float]] = {name: [] for name in rows}
    for _ in range(args.repeats):
        for name, run in rows.items():
            samples[name].append(timed(run, steps))
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, numba {numba.__version__}, "
        f"MuJoCo {mujoco.__version__}; {args.repeats} repeats of {steps} steps of 1 ms, processor time"
    )
    print("\n| | us/step | min..max | x real time | ratio |\n|---|---:|---:|---:|---:|")
    base = statistics.median(samples["plant, semi-implicit"])
    for name, values in samples.items():
        median = statistics.median(values)
        print(
            f"| {name} | {median:.2f} | {min(values):.2f}..{max(values):.2f} | {1000.0 / median:.0f} | {median / base:.2f} |"
        )


if __name__ == "__main__":
    main()
