"""A machine for the bench that has nothing of loaderhil: python-can and cantools alone. It stands still; a simulator would move it.

python foreign_plant.py INTERFACE CHANNEL loader.dbc      # socketcan can0, or loaderhil /tmp/loaderhil.hub
"""

import sys
import time

import can
import cantools
from foreign_ecu import PERIOD_S, protect

STANDING = {
    "BodyAcceleration": {"Vertical": 9.81},
    "LiftPressure": {"LiftCylinderPressure": 5000},
    "TiltPressure": {"TiltCylinderPressure": 3000},
    "LinkageAngles": {"LiftArmAngle": -37.0},
    "SteeringPressures": {"LeftLine": 1500, "RightLine": 1500},
}


def values(message, sequence: int) -> dict[str, float]:
    """The signals of one message: everything zero and healthy, but for what gravity does."""
    sent = dict.fromkeys((signal.name for signal in message.signals), 0)
    if message.name == "Articulation":
        sent["SampleSequence"] = sequence % 65536
    return sent | STANDING.get(message.name, {})


def main(interface: str, channel: str, dbc: str) -> None:
    """Send every message at its cycle time until the bus is gone or Ctrl-C, and print when the ECU's limits change."""
    database = cantools.database.load_file(dbc)
    mine = [message for message in database.messages if "Machine" in message.senders]
    limits = database.get_message_by_name("Limits")
    tick, started_s, last = 0, time.monotonic(), None
    with can.Bus(interface=interface, channel=channel) as bus:
        while True:
            due_s = started_s + tick * PERIOD_S
            while (frame := bus.recv(max(0.0, due_s - time.monotonic()))) is not None:
                if frame.arbitration_id == limits.frame_id:
                    received = limits.decode(frame.data)
                    if (now := (received["Speed"], received["ArticulationRate"])) != last:
                        print("limits: {} km/h, {} deg/s".format(*now), flush=True)
                        last = now
            for message in mine:
                every = message.cycle_time // 10
                if tick % every == 0:
                    data = protect(
                        message, message.encode(values(message, tick), strict=True), tick // every % 15
                    )
                    bus.send(can.Message(arbitration_id=message.frame_id, is_extended_id=True, data=data))
            tick += 1


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except can.CanError as error:
        sys.exit(f"the bus is gone: {error}")
