"""A machine that sends the values it is given: frames of every message the ECU hears, through the real codec."""

from bus.frame import Frame
from dbc import loader_database
from dbc.schedule import FrameSchedule

PERIOD_NS = 10_000_000
STANDING = {
    "articulation_angle": 0.0, "articulation_rate": 0.0, "sequence": 0.0, "health": 0.0,
    **{f"wheel_speed_{n}": 0.0 for n in (1, 2, 3, 4)},
    **{f"wheel_torque_{n}": 0.0 for n in (1, 2, 3, 4)},
    "specific_force_x": 0.0, "specific_force_y": 0.0, "specific_force_z": 9.81,
    "roll_rate": 0.0, "pitch_rate": 0.0, "yaw_rate": 0.0, "pitch": 0.0, "roll": 0.0,
    "lift_pressure": 3.56e6, "tilt_pressure": 1.45e6, "lift_arm_angle": -0.6458, "tilt_angle": 0.8203,
    "steering_pressure_left": 0.5e6, "steering_pressure_right": 0.5e6,
    "torque_demand": 0.0, "brake_demand": 0.0, "articulation_rate_demand": 0.0, "lift_demand": 0.0,
    "tilt_demand": 0.0, "speed": 0.0,
}  # fmt: skip
MESSAGES = {
    "Articulation": {
        "ArticulationAngle": ("rad", "articulation_angle"),
        "ArticulationRate": ("rad/s", "articulation_rate"),
        "SampleSequence": ("1", "sequence"),
        "State": ("1", "health"),
    },
    **{
        f"Wheel{what}s{axle}": {
            "Left": (unit, f"wheel_{what.lower()}_{left}"),
            "Right": (unit, f"wheel_{what.lower()}_{left + 1}"),
            "LeftState": ("1", "health"),
            "RightState": ("1", "health"),
        }
        for what, unit in (("Speed", "rad/s"), ("Torque", "N.m"))
        for axle, left in (("Front", 1), ("Rear", 3))
    },
    "BodyAcceleration": {
        "Longitudinal": ("m/s2", "specific_force_x"),
        "Lateral": ("m/s2", "specific_force_y"),
        "Vertical": ("m/s2", "specific_force_z"),
        "State": ("1", "health"),
    },
    "BodyRates": {
        "RollRate": ("rad/s", "roll_rate"),
        "PitchRate": ("rad/s", "pitch_rate"),
        "YawRate": ("rad/s", "yaw_rate"),
        "State": ("1", "health"),
    },
    "SlopeSensor": {
        "PitchAngle": ("rad", "pitch"),
        "RollAngle": ("rad", "roll"),
        "PitchRate": ("rad/s", "pitch_rate"),
    },
    "LiftPressure": {"LiftCylinderPressure": ("Pa", "lift_pressure")},
    "TiltPressure": {"TiltCylinderPressure": ("Pa", "tilt_pressure")},
    "LinkageAngles": {
        "LiftArmAngle": ("rad", "lift_arm_angle"),
        "TiltAngle": ("rad", "tilt_angle"),
        "State": ("1", "health"),
    },
    "SteeringPressures": {
        "LeftLine": ("Pa", "steering_pressure_left"),
        "RightLine": ("Pa", "steering_pressure_right"),
        "LeftLineState": ("1", "health"),
        "RightLineState": ("1", "health"),
    },
    "DriverDemand": {
        "TorqueDemand": ("1", "torque_demand"),
        "BrakeDemand": ("1", "brake_demand"),
        "ArticulationRateDemand": ("rad/s", "articulation_rate_demand"),
        "LiftDemand": ("1", "lift_demand"),
        "TiltDemand": ("1", "tilt_demand"),
    },
    "VehicleSpeed": {"WheelBasedVehicleSpeed": ("m/s", "speed")},
}


class FakeMachine:
    """Sends `values` at the DBC's cycle times; messages in `silent` are left out."""

    def __init__(self, **values: float) -> None:
        self.values = STANDING | values
        self.silent: set[str] = set()
        self.tick = 0
        self._schedule = FrameSchedule(loader_database(), "Machine", MESSAGES, tick_ns=PERIOD_NS)
        self._names = {codec.can_id: name for name, codec in loader_database().by_name.items()}

    @property
    def now_ns(self) -> int:
        """Time of the tick that comes next."""
        return self.tick * PERIOD_NS

    def frames(self) -> list[Frame]:
        """The frames of this tick."""
        self.values["sequence"] = float(self.tick % 65536)
        sent = self._schedule.frames(self.tick, self.values)
        now = self.now_ns
        self.tick += 1
        return [f._replace(at_ns=now) for f in sent if self._names[f.can_id] not in self.silent]


def play(cycle, machine, ticks, spoil=None):
    """Run the two together; returns ticks and findings. `spoil` may change a frame or drop it with None."""
    results, findings = [], []
    for _ in range(ticks):
        now = machine.now_ns
        for frame in machine.frames():
            changed = spoil(frame) if spoil else frame
            if changed is not None:
                findings += cycle.receive(changed, now)
        result = cycle.tick(now + PERIOD_NS // 2)
        findings += result.findings
        results.append(result)
    return results, findings


def decoded(frames):
    """Signals of frames by message."""
    database = loader_database()
    return {database.by_id[f.can_id].name: database.by_id[f.can_id].decode_dict(f.data) for f in frames}
