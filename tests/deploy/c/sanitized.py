"""Plays random frames into a sanitized build, as a program of its own: a sanitizer that finds something ends the process.

python -m tests.deploy.c.sanitized LIBRARY SEED FRAMES
"""

import random
import sys

from ecu.calibration import load_calibration
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import RandomDrive, random_frames


def main(library, seed, frames):
    """Random contents, then as many in which the estimators run: random bits alone lead into FAULT. Sensors are tested in both."""
    ecu, generator, last = BuiltEcu(library, detect_faults=True), random.Random(seed), 0
    for frame, at in random_frames(seed, frames):
        last = at
        if frame is not None:
            ecu.receive(frame, at)
        else:
            ecu.overran(generator.randrange(3))
            ecu.executed(generator.getrandbits(34))
            ecu.tick(at)
    for frame, at in RandomDrive(load_calibration(), seed).calls(frames):
        if frame is not None:
            ecu.receive(frame, last + at)
        else:
            ecu.tick(last + at)
    print(frames)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
