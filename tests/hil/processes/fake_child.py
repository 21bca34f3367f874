"""A process for the supervisor to look after: `python fake_child.py BEHAVIOUR`."""

import signal
import sys
import time

from hil.shell.lifeline import Lifeline


def main(behaviour: str) -> int:
    line = Lifeline.from_environment()
    match behaviour:
        case "refuse":
            line.error("no bus at hub:/nowhere")
            return 4
        case "never-ready":
            time.sleep(60)
        case "deaf":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
    line.ready()
    if behaviour.startswith("strike"):
        _, kinds, target = behaviour.split(" ")
        line.wait_for_go()
        for kind in kinds.split(","):
            line.act(kind, target)
    if behaviour == "work":
        line.wait_for_go()
        line.progress(1.0, 2.0)
        line.waited(5, 9, 3)
        line.waited(9, 14, 4)
        line.finished(complete=True, ticks=200)
        return 0
    time.sleep(60)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
