"""The Python API of the bench: start, step, stimulate, wait for, assert within; in lockstep and in real time alike.

    async with Bench.lockstep("loaded") as bench:
        await bench.wait_for("EcuStatus.State == running", within_s=1.0)
        await bench.stimulate("BodyRates.RollRate", 160.0)
        await bench.expect("EcuStatus.State == degraded", within_s=0.1)

`blocking(...)` gives the same without asyncio. docs/howto/test-in-python.md
"""

from testbench.api.bench import Bench, BenchEnded, Moment, NotMet
from testbench.api.blocking import BlockingBench, blocking

__all__ = ["Bench", "BenchEnded", "BlockingBench", "Moment", "NotMet", "blocking"]
