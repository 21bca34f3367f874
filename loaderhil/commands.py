"""The table of all commands, for the help page and for loading.

A command's module is imported when the command is used. The help page needs this table only: importing every
command would load numpy and pandas.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Command:
    """One command of the command line."""

    module: str  # import name of the module whose `register(app)` adds the command
    summary: str  # one line for the help page: the first sentence of the command's own help


PANELS: Final[dict[str, dict[str, Command]]] = {
    "The bench": {
        "demo": Command(
            "loaderhil.run_commands",
            "Run one roll-over twice, without and with the ECU's limits, and compare.",
        ),
        "run": Command("loaderhil.run_commands", "Run one or several scenarios and show the results."),
        "compile": Command(
            "loaderhil.ahead",
            "Compile plant and ECU ahead, at the same time, so that the next run starts at once.",
        ),
        "plant": Command(
            "loaderhil.process_commands", "Start the simulated machine as a process, until its scenario ends."
        ),
        "ecu": Command("loaderhil.process_commands", "Start the virtual ECU as a process, until Ctrl-C."),
        "hub": Command(
            "loaderhil.process_commands",
            "Start a CAN bus for computers without CAN hardware, until Ctrl-C.",
        ),
        "gateway": Command(
            "hil.processes.gateway_command",
            "Forward frames between the machine's bus and the ECU's bus, until Ctrl-C.",
        ),
        "attend": Command(
            "hil.foreign.command",
            "Wait for a node on a bus, and report when it falls silent and when it is back.",
        ),
        "restbus": Command(
            "loaderhil.testing.restbus",
            "Simulate nodes of a DBC on a bus: every cyclic and event message, with right counters and checksums.",
        ),
        "conform": Command(
            "loaderhil.testing.conform",
            "Test a controller against its DBC: presence, cycle times, contents, start-up, states after loss of inputs.",
        ),
        "compare": Command(
            "loaderhil.testing.compare",
            "Compare two runs: estimates, warnings, states and timing, each within a tolerance.",
        ),
        "verify": Command(
            "loaderhil.testing.verify",
            "Run expectations against faults, planted ECU errors and effects, and list those that nobody notices.",
        ),
        "inject": Command(
            "hil.faults.command", "Inject faults into a running gateway, list them, or end them."
        ),
        "deploy": Command(
            "deploy.command",
            "Run the ECU as a service of a Linux computer: `deploy new`, `deploy check`, `deploy units`.",
        ),
        "export-c": Command(
            "deploy.c.command",
            "Write the ECU as C99 for a microcontroller: single precision, no heap; with builds for Linux and a Cortex-M4F.",
        ),
        "export-fmu": Command(
            "loaderhil.fmu",
            "Write the simulated machine as an FMU for co-simulation: commands to its actuators in, its motion out.",
        ),
        "export-a2l": Command(
            "deploy.a2l.command",
            "Write the A2L file of the ECU: everything that a tool can measure and calibrate by XCP, with addresses and ranges.",
        ),
        "soak": Command(
            "studies.soak.command",
            "Test the ECU with random faults in random drives: is every fault detected, and do states and outputs stay as declared?",
        ),
    },
    "Buses and recordings": {
        "monitor": Command(
            "hil.monitor.command",
            "Show the frames of buses or recordings: as a table, as decoded lines, or as candump prints them.",
        ),
        "record": Command(
            "hil.recording.command", "Record every frame of one or several buses, until Ctrl-C."
        ),
        "replay": Command(
            "hil.replay.command", "Send a recording to a bus with its recorded timing, or feed it to the ECU."
        ),
        "check": Command(
            "hil.check.command", "Check the timing of every message in a recording against its cycle time."
        ),
        "decode": Command("hil.recording.decode", "Decode recordings into one table per message."),
        "export": Command(
            "loaderhil.export", "Write a decoded recording as MCAP, for Foxglove and PlotJuggler."
        ),
        "mqtt": Command(
            "hil.mqtt.command", "Publish decoded signals and findings to an MQTT broker, until Ctrl-C."
        ),
    },
    "What physics was left out": {
        "diagnose": Command(
            "diagnosis.command",
            "Find what a model leaves out: where it differs from the recordings, and the name and size of the missing effect.",
        ),
        "experiment": Command(
            "diagnosis.experiment.command",
            "Find the manoeuvre that distinguishes best what the recordings cannot, and write it as a scenario; with --sealed, drive it and go on.",
        ),
        "conceal": Command(
            "diagnosis.blind.conceal",
            "Write a recording with hidden effects, parameter errors, noise and faults, and seal the truth in a separate file.",
        ),
        "score": Command(
            "diagnosis.blind.score",
            "Open the sealed truth and compare it with the findings: hidden effects, found effects, and their values.",
        ),
        "model": Command(
            "diagnosis.skeleton",
            "Write a model of your own, `model new TABLE --out model.py`, or use an FMU, `model describe FILE.fmu`.",
        ),
        "effects": Command(
            "loaderhil.effects",
            "List the physics that machine files leave out (`effects`, `effects NAME`), or add what a diagnosis found.",
        ),
    },
    "Parameters from measurements": {
        "identify": Command(
            "identify.command",
            "Find tyre and machine parameters in raw measurements, or make such measurements.",
        ),
    },
    "The machine and its results": {
        "scenarios": Command(
            "loaderhil.result_commands",
            "List the scenarios that come with loaderhil, or check scenario files.",
        ),
        "report": Command(
            "loaderhil.result_commands", "Write one self-contained HTML page about one or more runs."
        ),
        "render": Command(
            "report.render.command",
            "Draw a run: the machine, its wheel loads as arrows, the ECU's warning. No display needed.",
        ),
        "standards": Command(
            "studies.standards.command",
            "Test a machine against standards: tipping load, stopping distance, steering course, 30° slope.",
        ),
        "thesis": Command(
            "studies.thesis.command",
            "List what the thesis left open, or measure one answer: a page with numbers and a picture.",
        ),
        "campaign": Command(
            "loaderhil.result_commands", "Run many simulations and write their results as one table."
        ),
    },
}
"""Panel of the help page -> name -> command, in the order of the help page."""

COMMANDS: Final = {name: command for panel in PANELS.values() for name, command in panel.items()}
