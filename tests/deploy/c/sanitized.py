"""Plays random frames into a sanitized build, as a program of its own: a sanitizer that finds something ends the process.

python -m tests.deploy.c.sanitized LIBRARY SEED FRAMES
"""

import random
import sys

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from ecu.calibration import load_calibration
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import RandomDrive
from tests.ecu.machine import MESSAGES, PERIOD_NS

CODECS = [loader_database().by_name[name] for name in MESSAGES]


def main(library, seed, frames):
    """Random contents, mostly signed, of random length now and then, at times that also run backwards."""
    ecu, generator, now = BuiltEcu(library), random.Random(seed), 0
    protectors = {c.can_id: Protector(c) for c in CODECS if c.e2e_data_id is not None}
    for k in range(frames):
        codec = CODECS[k % len(CODECS)]
        data = generator.randbytes(codec.length)
        if codec.can_id in protectors and generator.random() < 0.95:
            data = protectors[codec.can_id].protect(data)
        if generator.random() < 0.01:
            data = data[: generator.randrange(9)]
        ecu.receive(
            Frame(codec.can_id if generator.random() < 0.99 else generator.getrandbits(29), data, now), now
        )
        if k % len(CODECS) == 0:
            now += generator.choice((PERIOD_NS, PERIOD_NS, PERIOD_NS, 7 * PERIOD_NS, -PERIOD_NS, 1 << 40))
            ecu.overran(generator.randrange(3))
            ecu.executed(generator.getrandbits(34))
            ecu.tick(now)
    # as many again in which the estimators run: random bits alone lead into FAULT
    for frame, at in RandomDrive(load_calibration(), seed).calls(frames):
        if frame is not None:
            ecu.receive(frame, now + at)
        else:
            ecu.tick(now + at)
    print(frames)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
