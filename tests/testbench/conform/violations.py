"""Controllers with one planted violation each: the example's ECU, bent in one place.

As a program: python violations.py INTERFACE CHANNEL loader.dbc NAME...
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))

import foreign_ecu

CONFORMING = foreign_ecu.Ecu


class Bent(foreign_ecu.Ecu):
    """The example's ECU with violations, by name."""

    names: tuple[str, ...] = ()

    def __init__(self, database):
        super().__init__(database)
        self.by_name = {message.name: message for message in database.messages}
        self.ever_lost = False
        self.sent_slowly = 0

    def step(self, now_s):
        if "ignores a loss" in self.names:
            self.heard_s[self.frame_id("BodyRates")] = now_s
        if "never recovers" in self.names:
            lost = [now_s - self.heard_s[each] > patience for each, patience in self.patience_s.items()]
            self.ever_lost |= any(lost) and self.tick > 150
            if self.ever_lost:
                self.heard_s[self.frame_id("Articulation")] = -1e9
        if "starts late" in self.names and self.tick < 200:
            self.heard_s[self.frame_id("Articulation")] = -1e9
        return [self.bent(*frame) for frame in super().step(now_s) if self.sent(frame[0])]

    def frame_id(self, name):
        return self.by_name[name].frame_id

    def sent(self, identifier):
        if "absent" in self.names and identifier == self.by_name["TurningTorque"].frame_id:
            return False
        if "slow" in self.names and identifier == self.by_name["NormalForces"].frame_id:
            return self.tick % 2 == 0
        return True

    def bent(self, identifier, data):
        message = next(m for m in self.mine if m.frame_id == identifier)
        frame = bytearray(data)
        if "short" in self.names and message.name == "Warnings":
            return identifier, bytes(frame[:4])
        if "slow" in self.names and message.name == "NormalForces":
            self.sent_slowly += 1
            return identifier, self.signed(message, frame, self.sent_slowly % 15)
        if "out of range" in self.names and message.name == "TyreForceFrontLeft":
            return identifier, self.changed(message, frame, Slip=65520)  # 65535 would be "not available"
        if "unknown state" in self.names and message.name == "RollOver":
            return identifier, self.changed(message, frame, State=5)
        if "counter stands" in self.names and message.name == "BodyMotion":
            return identifier, self.signed(message, frame, 3)
        if "wrong data id mode" in self.names and message.name == "LinkageLimits":
            frame[0] = foreign_ecu.crc8(bytes([message.dbc.attributes["E2EDataId"].value & 0xFF]) + frame[1:])
        if "valid from the start" in self.names and message.name == "TyreForceRearLeft":
            return identifier, self.changed(message, frame, ForceValid=1)
        return identifier, bytes(frame)

    def changed(self, message, frame, **raw):
        """The frame with other raw values, signed."""
        values = message.decode(bytes(frame), decode_choices=False, scaling=False) | raw
        data = bytearray(message.encode(values, scaling=False, strict=False))
        return self.signed(message, data, frame[1] & 0x0F)

    @staticmethod
    def signed(message, frame, counter):
        return foreign_ecu.protect(message, bytes(frame), counter)


VIOLATIONS = {
    "absent": ("TurningTorque", "presence"),
    "slow": ("NormalForces", "cycle time"),
    "short": ("Warnings", "length"),
    "out of range": ("TyreForceFrontLeft", "range"),
    "unknown state": ("RollOver", "value table"),
    "counter stands": ("BodyMotion", "counter"),
    "wrong data id mode": ("LinkageLimits", "CRC"),
    "valid from the start": ("TyreForceRearLeft", "initial values"),
    "ignores a loss": ("loss of BodyRates", "state after loss"),
    "starts late": ("EstimatorEcu", "start-up"),
    "never recovers": ("return of BodyRates", "recovery"),
}
"""Name -> the requirement that is broken."""


def bent(*names):
    """An ECU class with these violations."""
    assert set(names) <= set(VIOLATIONS)
    return type("Planted", (Bent,), {"names": names})


if __name__ == "__main__":
    foreign_ecu.Ecu = bent(*sys.argv[4:]) if sys.argv[4:] else CONFORMING
    foreign_ecu.main(*sys.argv[1:4])
