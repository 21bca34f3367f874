"""Lateral forces wheel by wheel: the whole chain from the plant to the frame."""

import numpy as np

from hil.compose import Choice, lockstep
from studies.campaigns.memory import columns_of

SCENARIO = """
name = "held_turn"
sentence = "3204 kg with the arm level in a held turn: loads of 43 and 70 kN in front."
duration_s = 5.0
machine = "l60"
seed = 7
payload_kg = 3204

[start]
speed_kmh = 13
lift_arm_deg = 10

[driver.speed_kmh]
points = [[0.0, 13]]

[driver.articulation_deg]
points = [[1.0, 0.0], [2.5, 24.0], [5.0, 24.0]]
"""
WHEELS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")


def test_lateral_forces_in_a_held_turn_are_those_of_each_wheel(tmp_path):
    """Shared by load the front wheels were 23 % too low and 31 % too high: the loaded tyre's stiffness grows less than its load."""
    path = tmp_path / "held_turn.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    recording = lockstep(Choice(scenario=str(path)).load(), limits=False, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.lateral_force for truth in recording.truth])[time > 3.0].mean(axis=0)
    messages = columns_of(recording.bus)
    for wheel, name in enumerate(WHEELS):
        columns = messages[f"TyreForce{name}"]
        held = columns.time_s > 3.0
        assert columns.signals["ForceValid"][held].all()
        found = 1e3 * columns.signals["Lateral"][held].mean()
        assert abs(found / force[wheel] - 1.0) < 0.1, name
