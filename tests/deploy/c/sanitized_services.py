"""Plays a tool's frames into a sanitized build of the services, as a program of its own: a sanitizer that finds something ends it.

python -m tests.deploy.c.sanitized_services LIBRARY SEED FRAMES
"""

import random
import sys

from bus.frame import Frame
from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.j1939.claim import message
from ecu.j1939.service import COMPONENT, REQUEST, SOFTWARE, address_of
from tests.deploy.c.beside import CServices
from tests.deploy.c.random_drives import RandomDrive
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET
from tests.fuzz.services import tool_frames, xcp_commands

TOOL = 0xF9
GROUPS = (0xEE00, SOFTWARE, COMPONENT, 0x1234)


def request(rng):
    """A request of J1939 as it should be, or any bits of a message of J1939."""
    if rng.random() < 0.5:
        data = rng.choice(GROUPS).to_bytes(3, "little")
        return message(REQUEST, TOOL, data, to=rng.choice((0xFF, address_of(loader_database()))))
    # not a claim of this address: the ECU would have lost it for good
    return message(rng.choice((REQUEST, 0xE800, 0xEC00)), rng.randrange(256), rng.randbytes(rng.randrange(9)))


def main(library, seed, frames):
    """Commands during a random drive in which sensors are tested, at times that also jump; prints the answers' frames."""
    ecu = CServices(library, xcp=XCP, uds=UDS, name=1, secret=SECRET, detect_faults=True)
    drive, rng = RandomDrive(load_calibration(), seed).calls(1 << 40), random.Random(seed)
    answered = now = late = 0

    def ask(packet):
        nonlocal answered
        answers = ecu.service(Frame(XCP.receive, packet), now)
        answered += len(answers)
        return [answer.data for answer in answers]

    commands = xcp_commands(rng, frames, ask, SECRET)
    for data in tool_frames(rng, frames):
        if data is not None:
            answered += len(ecu.service(Frame(UDS.receive, data), now))
            next(commands, None)
            if rng.random() < 0.1:
                answered += len(ecu.service(request(rng), now))
            continue
        for frame, at in drive:
            now = at + late
            if frame is None:
                break
            ecu.receive(frame, now)
        ecu.before_cycle(now)
        ecu.tick(now)
        answered += len(ecu.after_cycle(now))
        if rng.random() < 0.01:
            late += rng.choice((1_100_000_000, 1 << 40))
    print(answered)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
