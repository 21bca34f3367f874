"""Plays a tool's frames into a sanitized build of the services, as a program of its own: a sanitizer that finds something ends it.

python -m tests.deploy.c.sanitized_services LIBRARY SEED FRAMES
"""

import random
import sys

from bus.frame import Frame
from tests.deploy.c.beside import CServices
from tests.ecu.machine import FakeMachine
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET
from tests.fuzz.services import tool_frames, xcp_commands


def main(library, seed, frames):
    """Commands while a machine stands and loses messages now and then, at times that also jump; prints the answers' frames."""
    ecu, machine, rng = (
        CServices(library, xcp=XCP, uds=UDS, secret=SECRET),
        FakeMachine(),
        random.Random(seed),
    )
    answered = late = 0

    def ask(packet):
        nonlocal answered
        answers = ecu.service(Frame(XCP.receive, packet), machine.now_ns + late)
        answered += len(answers)
        return [answer.data for answer in answers]

    commands = xcp_commands(rng, frames, ask, SECRET)
    for data in tool_frames(rng, frames):
        now = machine.now_ns + late
        if data is not None:
            answered += len(ecu.service(Frame(UDS.receive, data), now))
            next(commands, None)
            continue
        machine.silent = {rng.choice(("SlopeSensor", "BodyRates"))} if rng.random() < 0.3 else set()
        for frame in machine.frames():
            ecu.receive(frame, now)
        late += rng.choice((0, 0, 0, 0, 0, 1_100_000_000, 1 << 40))
        ecu.before_cycle(now)
        ecu.tick(now)
        answered += len(ecu.after_cycle(now))
    print(answered)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
