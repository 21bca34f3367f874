"""What the ECU sends: which value goes into which signal, and when. Signal names of the DBC end here."""

from collections.abc import Mapping
from typing import Final

from bus.frame import Frame
from dbc.database import Database
from dbc.packing import Signals
from dbc.schedule import FrameSchedule

ECU = "EstimatorEcu"
TICK_NS: Final = 10_000_000
_WHEELS: Final = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")


def _messages() -> dict[str, Signals]:
    """Message -> signal -> (SI unit, value's name)."""
    numbered = list(enumerate(_WHEELS, 1))
    return {
        "NormalForces": {wheel: ("N", f"normal_{n}") for n, wheel in numbered}
        | {f"{wheel}Valid": ("1", "normal valid") for wheel in _WHEELS},
        **{
            f"TyreForce{wheel}": {
                "Longitudinal": ("N", f"longitudinal_{n}"),
                "Lateral": ("N", f"lateral_{n}"),
                "Slip": ("1", f"slip_{n}"),
                "ForceValid": ("1", f"force_{n} valid"),
                "SlipValid": ("1", f"slip_{n} valid"),
            }
            for n, wheel in numbered
        },
        "RollOver": {
            "LoadTransferRatio": ("1", "load_transfer_ratio"),
            "PredictedLoadTransferRatio": ("1", "predicted_load_transfer_ratio"),
            "LiftOffMargin": ("1", "lift_off_margin"),
            "TimeToLiftOff": ("s", "time_to_lift_off"),
            "State": ("1", "roll-over state"),
            "LiftingWheel": ("1", "lifting_wheel"),
            "Valid": ("1", "roll_over valid"),
        },
        "TurningTorque": {
            "YawMoment": ("N.m", "yaw_moment"),
            "JointTorque": ("N.m", "joint_torque"),
            "YawRate": ("rad/s", "yaw_rate"),
            "MomentValid": ("1", "yaw_moment valid"),
            "TorqueValid": ("1", "joint_torque valid"),
        },
        "BodyMotion": {
            "Speed": ("m/s", "speed"),
            "LongitudinalAcceleration": ("m/s2", "specific_force_x"),
            "LateralAcceleration": ("m/s2", "specific_force_y"),
            "PayloadMass": ("kg", "payload"),
            "PayloadValid": ("1", "payload valid"),
        },
        "Warnings": {"Level": ("1", "warning level")}
        | {
            reason: ("1", f"reason {reason}")
            for reason in (
                "RollOverPredicted", "RollOverNow", "WheelLifted", "WheelSpin", "WheelLock", "AxleOverload",
                "ArticulationNearStop", "SteepSlope", "PayloadHigh", "InputStale", "InputImplausible",
                "ProtectionError", "CycleOverrun", "EstimateInvalid",
            )
        },
        "Limits": {
            "FrontLeftTorque": ("N.m", "limit front torque"),
            "FrontRightTorque": ("N.m", "limit front torque"),
            "RearLeftTorque": ("N.m", "limit rear torque"),
            "RearRightTorque": ("N.m", "limit rear torque"),
            "Speed": ("m/s", "limit speed"),
            "ArticulationRate": ("rad/s", "limit rate"),
            "Cause": ("1", "limit cause"),
        },
        "EcuStatus": {
            "EchoSequence": ("1", "echo"),
            "ExecutionTime": ("s", "execution time"),
            "Overruns": ("1", "overruns"),
            "State": ("1", "state"),
            "StaleInputs": ("1", "stale inputs"),
        },
        "StabilityControl": {
            "RopEngineControlActive": ("1", "prevention limits torque"),
            "RopBrakeControlActive": ("1", "prevention limits speed"),
        },
    }  # fmt: skip


class Answers:
    """Makes the ECU's frames."""

    def __init__(self, database: Database) -> None:
        self._schedule = FrameSchedule(database, ECU, _messages(), tick_ns=TICK_NS)

    def frames(self, tick: int, values: Mapping[str, float]) -> list[Frame]:
        """The frames due at tick number `tick`; `values` by the names above, SI."""
        return self._schedule.frames(tick, values)
