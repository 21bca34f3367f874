"""The shipped drive cases do what their sentences say; limits are ignored unless a test says otherwise."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from plant.sheets.machine import load_machine
from plant.truth import columns_of
from plant.unit.profile import Profile
from plant.unit.scenario import Scenario, list_scenarios, load_scenario
from plant.unit.unit import TICK_NS, PlantUnit
from tests.plant.unit.test_unit import Ecu

G = 9.81
FL, FR, RL, RR = range(4)
NAMES = [summary.name for summary in list_scenarios()]
UPRIGHT = [name for name in NAMES if name != "abrupt_articulation"]


@dataclass(frozen=True)
class Run:
    """The true motion of a whole run."""

    columns: dict[str, NDArray[np.float64]]
    rolled_over: bool

    def __getitem__(self, field: str) -> NDArray[np.float64]:
        return self.columns[field]

    def lift_off(self, wheel: int) -> float:
        """When the wheel first carries nothing [s]; infinity: never."""
        up = np.flatnonzero(self["normal_force"][:, wheel] == 0)
        return float(self["time_s"][up[0]]) if up.size else np.inf

    def at(self, field: str, time: float) -> NDArray[np.float64]:
        return self[field][np.searchsorted(self["time_s"], time - 1e-9)]


def simulate(scenario: Scenario, limited_from: float = np.inf, **limits: float) -> Run:
    """Run it; from `limited_from` [s] on an ECU sends these limits, which the machine obeys."""
    obey = bool(limits)
    machine = load_machine(scenario.machine, scenario.changes.machine)
    unit = PlantUnit(machine, scenario, seed=scenario.seed, obey_limits=obey)
    free, strict = Ecu(), Ecu(**limits)
    strict._protector = free._protector  # one sender, one counter
    rows = []
    tick = 0
    while not unit.finished:
        unit.tick(tick * TICK_NS)
        rows.append(unit.truth.row.copy())
        if obey:
            ecu = strict if unit.truth.time_s >= limited_from else free
            unit.receive(ecu.frame(), tick * TICK_NS + TICK_NS // 2)
        tick += 1
    return Run(columns_of(np.array(rows)), unit.rolled_over)


@cache
def shipped(name: str) -> Run:
    return simulate(load_scenario(name))


@pytest.mark.parametrize("name", UPRIGHT)
def test_it_runs_to_its_end_on_four_wheels(name):
    run = shipped(name)
    assert run["time_s"][-1] == pytest.approx(load_scenario(name).duration_s)
    assert all(np.isfinite(column).all() for column in run.columns.values())
    assert run["normal_force"].min() > 0


@pytest.mark.parametrize("name", [name for name in UPRIGHT if name != "pile_entry"])
def test_on_average_the_tyres_carry_the_weight(name):
    """Level ground and no net vertical motion: the mean of the sum is m g, to 0.2 % of tilted tyre axes."""
    weight = (11_842 + load_scenario(name).payload_mass) * G  # thesis table 2
    assert shipped(name)["normal_force"].sum(axis=1).mean() == pytest.approx(weight, rel=2e-3)


def test_a_pile_stops_the_machine_and_leaves_its_weight_on_the_bucket():
    """The traction that the pile takes, up to its 60 kN, and half of that as weight from then on.

    20 %: it is not dug to its full resistance.
    """
    run = shipped("pile_entry")
    time = run["time_s"]
    before, after = (run["normal_force"][part].sum(axis=1).mean() for part in (time < 2.0, time > 13.0))
    pushed = run["longitudinal_force"][time < 7.0].sum(axis=1).max()
    assert 50e3 < pushed < 65e3, "60 kN and what still accelerates the machine"
    assert after - before == pytest.approx(0.5 * 60e3, rel=0.2)
    assert run.at("speed", 3.6) < 0.5 * run.at("speed", 1.9)


def test_full_brakes_on_wet_ground_lock_every_wheel():
    run = shipped("wheel_lock")
    sliding = (run["time_s"] > 2.8) & (run["time_s"] < 3.6)
    assert not run["wheel_speed"][sliding].any()
    assert run["speed"][sliding].min() > 0.5


def test_standstill_stands_still():
    run = shipped("standstill")
    assert np.linalg.norm(run["position"] - run["position"][0], axis=1).max() < 1e-4
    assert np.abs(run["wheel_speed"]).max() < 1e-4


def test_hard_braking_reaches_its_deceleration_within_the_ramp_and_the_lag():
    """0.5 to 0.6 g between the end of the ramp and standstill; from 25 km/h that takes about 1.3 s."""
    run = shipped("hard_braking")
    time, speed = run["time_s"], run["speed"]
    steady = (time > 3.4) & (speed > 1.0)
    deceleration = -np.polyfit(time[steady], speed[steady], 1)[0]
    assert 0.5 * G < deceleration < 0.6 * G
    assert run.at("cog_specific_force", 2.9)[0] == pytest.approx(0.0, abs=0.2)
    assert run.at("cog_specific_force", 3.4)[0] < -0.4 * G
    stopped = 3.075 + run.at("speed", 3.0) / deceleration
    assert (run["wheel_speed"][time > stopped + 0.5] == 0).all()  # locked; the body still rocks on its tyres
    front = run["normal_force"][:, :2].sum(axis=1)
    assert front.max() > front[0] + 11_842 * deceleration * 1.09 / 3.0  # more than quasi-static: pitching


def test_transient_torque_holds_20_degrees_and_swings_25_kn_at_0_3_hz():
    """What the tyres give is the drive torque less what spins the wheels: m/(m + 4 J/r^2) of 25 kN."""
    run = shipped("transient_torque")
    swing = (run["time_s"] >= 4.0) & (run["time_s"] < 14.0)  # three periods
    assert np.abs(np.degrees(run["articulation_angle"][swing]) - 20.0).max() < 1.0
    tractive = run["wheel_torque"][swing].sum(axis=1) / 0.72
    force = run["longitudinal_force"][swing].sum(axis=1)
    spectrum = np.fft.rfft(np.stack([tractive, force]), axis=1) / (swing.sum() / 2)
    assert np.abs(spectrum[:, 1:]).argmax(axis=1).tolist() == [2, 2]  # third line of 0.1 Hz
    drive, road = np.abs(spectrum[:, 3])
    assert drive == pytest.approx(25e3, rel=0.01)
    assert road == pytest.approx(25e3 * 11_842 / (11_842 + 4 * 110 / 0.72**2), rel=0.02)


def test_transient_articulation_swings_30_degrees_to_either_side_at_its_speed():
    run = shipped("transient_articulation")
    angle = np.degrees(run["articulation_angle"])
    assert angle.max() == pytest.approx(30.0, abs=2.0)
    assert angle.min() == pytest.approx(-30.0, abs=2.0)
    assert run["speed"] * 3.6 == pytest.approx(np.full_like(angle, 10.0), abs=0.5)


def test_high_articulation_turns_close_to_the_stop_either_way_at_speed():
    run = shipped("high_articulation")
    angle = np.degrees(run["articulation_angle"])
    assert 35.0 < angle.max() < 40.0
    assert -40.0 < angle.min() < -35.0
    assert (run["speed"] * 3.6).min() > 10.0


@pytest.mark.parametrize("name", ["unloaded", "loaded"])
def test_the_drive_cycle_accelerates_turns_stops_and_reverses(name):
    run = shipped(name)
    speed, angle = run["speed"] * 3.6, np.degrees(run["articulation_angle"])
    assert speed[0] == pytest.approx(0.0, abs=0.01)
    assert speed.max() > 17.0
    assert speed[-1] < -4.0
    assert angle.max() > 30.0
    assert angle.min() < -15.0
    assert np.abs(run.at("speed", 34.9)) < 0.1


def test_the_loaded_cycle_lifts_its_bucket_load_at_the_stop():
    """80 % of 16.7 deg/s for 4.6 s; the lag of the cylinders does not change the integral."""
    run = shipped("loaded")
    assert (run["payload_mass"] == 3204).all()
    assert np.degrees(run["lift_arm_angle"][[0, -1]]) == pytest.approx([-37.0, -37.0 + 61.5], abs=0.5)


def test_abrupt_articulation_rolls_over_and_front_left_lifts_first():
    """Thesis 4.5.6. Lift-off near the quasi-static 4.8 to 5.7 m/s2 across at 40 to 20 degrees."""
    run = shipped("abrupt_articulation")
    assert run.rolled_over
    first = run.lift_off(FL)
    assert 4.0 < first < 6.0  # the joystick moves at 4 s
    assert first < min(run.lift_off(wheel) for wheel in (FR, RL, RR))
    assert 4.3 < run.at("cog_specific_force", first)[1] < 6.0
    assert np.degrees(run.at("roll", first)) < 5.0  # it is still on its tyres: tipping comes after
    assert np.degrees(run["roll"][-1]) > 60.0
    assert (
        np.degrees(run["oscillation_angle"].min()) < -13.0
    )  # the axle is on its stop before rear left lifts


def test_the_same_to_the_right_is_the_mirror_image():
    """With ideal sensors nothing distinguishes left from right."""
    scenario = load_scenario("abrupt_articulation")
    angle = scenario.script.articulation_angle
    mirrored = replace(scenario.script, articulation_angle=Profile(tuple((t, -v) for t, v in angle.points)))
    ideal = replace(scenario.equipment, sensors=type(scenario.equipment.sensors)())
    left = simulate(replace(scenario, equipment=ideal))
    right = simulate(replace(scenario, equipment=ideal, script=mirrored))
    assert right.lift_off(FR) == left.lift_off(FL) < right.lift_off(FL)
    upright = left["time_s"] < 6.0
    np.testing.assert_allclose(right["roll"][upright], -left["roll"][upright], atol=1e-6)


@pytest.mark.parametrize(("speed", "lifts"), [(15.0, False), (18.0, True)])
def test_the_speed_at_which_the_first_wheel_lifts(speed, lifts):
    """Quasi-static theory: 16 to 17.3 km/h at full lock, empty; the machine scrubs off some speed on its way there."""
    scenario = load_scenario("abrupt_articulation")
    held = Profile(((0.0, speed / 3.6),))
    slower = replace(
        scenario,
        start=replace(scenario.start, speed=speed / 3.6),
        script=replace(scenario.script, speed=held),
    )
    run = simulate(slower)
    assert not run.rolled_over
    assert (run.lift_off(FL) < np.inf) == lifts


def test_limits_that_come_a_tenth_of_a_second_after_the_joystick_keep_it_on_four_wheels():
    run = simulate(load_scenario("abrupt_articulation"), limited_from=4.1, speed_kmh=12.0, rate_deg_s=15.0)
    assert not run.rolled_over
    assert run["normal_force"].min() > 5e3
    assert run["time_s"][-1] == pytest.approx(10.0)
