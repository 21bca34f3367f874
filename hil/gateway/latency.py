"""Turns the stamps that the processes of a run left in its directory into timing.npz and latency.hlog."""

import datetime
from pathlib import Path

from hil import rundir
from hil.gateway import histograms
from hil.gateway.hops import StampFiles, hops, way_of_reactions
from hil.gateway.tap import read_stamps, ticks_of

PROCESSES = ("plant", "ecu", "gateway-plant", "gateway-ecu")
TICKING = ("plant", "ecu")


def keep_ticks(out: Path, process: str) -> None:
    """Write the ticks among the stamps of a process as its part of the run's timing; a killed process left those until its end."""
    ticks = ticks_of(read_stamps(rundir.stamps(out, process)))
    if ticks["due_ns"].size:
        rundir.write_table(rundir.part_of_timing(out, process), ticks)


def conclude(out: Path, record: rundir.RunRecord) -> None:
    """Write ticks and reaction paths into the run's timing and their histograms into latency.hlog; remove the stamps."""
    files = [rundir.stamps(out, process) for process in PROCESSES]
    plant, ecu, gateway_plant, gateway_ecu = (read_stamps(file) for file in files)
    way = way_of_reactions(
        StampFiles(plant=plant, ecu=ecu, gateway_plant=gateway_plant, gateway_ecu=gateway_ecu)
    )
    if any(column.size for column in way.values()):
        rundir.write_table(rundir.part_of_timing(out, "way"), way)
        with rundir.writing(out / rundir.LATENCY):
            histograms.write_log(
                out / rundir.LATENCY,
                histograms.counted(hops(way)),
                start_s=datetime.datetime.fromisoformat(record.started).timestamp(),
                duration_s=record.duration_s,
            )
    for process in TICKING:
        keep_ticks(out, process)
    for file in files:
        file.unlink(missing_ok=True)
