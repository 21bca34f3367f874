"""An ECU for the bench that has nothing of loaderhil: python-can and cantools alone. It estimates nothing; it shows what a bus asks of an ECU.

python foreign_ecu.py INTERFACE CHANNEL loader.dbc      # socketcan can0, or loaderhil /tmp/loaderhil.hub
"""

import sys
import time

import can
import cantools

PERIOD_S = 0.01
RUNNING, DEGRADED, SAFE_VALUES, NOT_AVAILABLE = 1, 2, 3, 7  # EcuStatus.State, Limits.Cause, RollOver
TORQUES = ("FrontLeftTorque", "FrontRightTorque", "RearLeftTorque", "RearRightTorque")


def attribute(message, name: str):
    """What the DBC says of a message, or None."""
    found = message.dbc.attributes.get(name)
    return None if found is None else found.value


def crc8(data: bytes) -> int:
    """CRC-8 of SAE J1850 (0x1D) with start value 0 and no final XOR, as AUTOSAR E2E profile 1 uses it."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc


def protect(message, data: bytes, counter: int) -> bytes:
    """Counter 0..14 into the low nibble of byte 1; CRC over data id (low, high byte) and payload into byte 0."""
    if (data_id := attribute(message, "E2EDataId")) is None:
        return data
    frame = bytes([data[1] & 0xF0 | counter]) + data[2:]
    return bytes([crc8(int(data_id).to_bytes(2, "little") + frame)]) + frame


def values(message, echo: int, stale: bool) -> dict[str, float]:
    """The signals of one message: nothing is valid, no limit but a speed that any loader may drive."""
    sent = {signal.name: max(0, signal.minimum or 0) for signal in message.signals}
    limits = (
        {"Speed": 8, "ArticulationRate": 10, "Cause": SAFE_VALUES}
        if stale
        else {"Speed": 50, "ArticulationRate": 50}
    )
    special = {
        "EcuStatus": {"EchoSequence": echo, "State": DEGRADED if stale else RUNNING, "StaleInputs": stale},
        "Limits": dict.fromkeys(TORQUES, 50) | limits,
        "RollOver": {"State": NOT_AVAILABLE, "LiftingWheel": NOT_AVAILABLE},
        "Warnings": {"InputStale": stale},
    }
    return sent | special.get(message.name, {})


class Ecu:
    """What the ECU is without a bus: frames that it hears, and one step per 10 ms that gives the frames to send."""

    def __init__(self, database) -> None:
        # What the DBC calls optional is left out: this ECU estimates nothing that it could be uncertain of.
        self.mine = [
            message
            for message in database.messages
            if "EstimatorEcu" in message.senders and not attribute(message, "SendOptional")
        ]
        self.sample = database.get_message_by_name("Articulation")
        # The DBC says which inputs matter, and how long each may stay away.
        needed = [m for m in database.messages if attribute(m, "InputLossState") == "degraded"]
        self.patience_s = {m.frame_id: attribute(m, "InputTimeout") / 1000 - 3 * PERIOD_S for m in needed}
        self.heard_s = dict.fromkeys(self.patience_s, -1e9)
        self.echo = self.tick = 0

    def receive(self, identifier: int, data: bytes, now_s: float) -> None:
        """Take one frame."""
        self.heard_s[identifier] = now_s
        if identifier == self.sample.frame_id:
            self.echo = self.sample.decode(data, decode_choices=False)["SampleSequence"]

    def step(self, now_s: float) -> list[tuple[int, bytes]]:
        """The frames of this tick: identifier and data."""
        stale = any(now_s - self.heard_s[each] > patience for each, patience in self.patience_s.items())
        frames = []
        for message in self.mine:
            every = message.cycle_time // 10
            if self.tick % every == 0:
                data = message.encode(values(message, self.echo, stale), strict=True)
                frames.append((message.frame_id, protect(message, data, self.tick // every % 15)))
        self.tick += 1
        return frames


def main(interface: str, channel: str, dbc: str) -> None:
    """Answer until the bus is gone or Ctrl-C."""
    ecu, started_s = Ecu(cantools.database.load_file(dbc)), time.monotonic()
    with can.Bus(interface=interface, channel=channel) as bus:
        while True:
            due_s = started_s + ecu.tick * PERIOD_S
            while (frame := bus.recv(max(0.0, due_s - time.monotonic()))) is not None:
                ecu.receive(frame.arbitration_id, frame.data, time.monotonic())
            for identifier, data in ecu.step(time.monotonic()):
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=True, data=data))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except can.CanError as error:
        sys.exit(f"the bus is gone: {error}")
