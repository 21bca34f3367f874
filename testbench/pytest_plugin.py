"""The pytest plugin: fixtures for benches, and the recording of every test that fails.

    def test_a_stuck_gyro_is_noticed(bench):
        bench.run_for(1.0)
        bench.stimulate("BodyRates.RollRate", 160.0)
        bench.expect("EcuStatus.State == degraded", within_s=0.1)

`@pytest.mark.bench(scenario="loaded")` chooses the scenario. Options and fixtures: docs/howto/test-in-python.md
"""

import re
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # the bench is imported on use: every pytest run of the computer loads this plugin
    from testbench.api import BlockingBench

FAILED = pytest.StashKey[bool]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The plugin's options."""
    group = parser.getgroup("loaderhil")
    group.addoption(
        "--bench-scenario", default="standstill", help="scenario of benches without a mark (standstill)"
    )
    group.addoption(
        "--bench-realtime", action="store_true", help="benches run as processes in real time, not in lockstep"
    )
    group.addoption(
        "--bench-ecu", metavar="BUS", default=None, help="bus of a real ECU; implies --bench-realtime"
    )
    group.addoption(
        "--bench-recordings",
        metavar="DIR",
        default="out/pytest",
        help="folder for the recordings of failed tests (out/pytest)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """The plugin's mark."""
    config.addinivalue_line(
        "markers", "bench(scenario, **choice): the scenario that the fixture `bench` runs, and how"
    )


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Note that a test failed, so that its fixture keeps the recording; name the recording in the report of the end."""
    report = yield
    # only the test itself decides: a failing teardown has its own report, after the fixture below has ended
    if report.when == "call":
        item.stash[FAILED] = report.failed
    return report


@pytest.fixture
def make_bench(
    request: pytest.FixtureRequest,
) -> Generator[Callable[..., "BlockingBench"], None, None]:
    """Makes benches: `make_bench("loaded", seed=3)`; all of them end with the test. In real time with --bench-realtime."""
    from testbench.api import Bench, blocking

    made: list[BlockingBench] = []
    config = request.config

    def make(scenario: str | Path, **choice: Any) -> "BlockingBench":
        ecu = config.getoption("--bench-ecu")
        if ecu or config.getoption("--bench-realtime"):
            bench = Bench.realtime(scenario, ecu=ecu, **choice)
        else:
            bench = Bench.lockstep(scenario, **choice)
        # entered by hand and not by `with`: how many benches a test makes is known only at its end
        made.append(blocking(bench).__enter__())
        return made[-1]

    try:
        yield make
    finally:
        for number, bench in enumerate(made):
            bench.__exit__(None, None, None)
            if request.node.stash.get(FAILED, False):
                _attach(request, bench, number)


def _attach(request: pytest.FixtureRequest, bench: "BlockingBench", number: int) -> None:
    """Keep a recording and say where: in the report, and as a property in JUnit."""
    # file names are limited to 255 bytes; the end of a node id holds the test and its parameters
    name = re.sub(r"[^\w.-]+", "_", request.node.nodeid)[-120:]
    folder = Path(request.config.getoption("--bench-recordings")) / (
        name if not number else f"{name}_{number}"
    )
    try:
        bench.keep(folder)
    except (OSError, ValueError) as error:  # a full disk must not hide why the test failed
        print(f"loaderhil: the recording could not be kept: {error}")
        return
    request.node.user_properties.append(("loaderhil recording", str(folder)))
    print(f"loaderhil recording: {folder} (loaderhil report {folder})")


@pytest.fixture
def bench(request: pytest.FixtureRequest, make_bench: Callable[..., "BlockingBench"]) -> "BlockingBench":
    """A bench that has been started: the scenario of `@pytest.mark.bench`, else that of --bench-scenario."""
    mark = request.node.get_closest_marker("bench")
    choice = dict(mark.kwargs) if mark else {}
    scenario = mark.args[0] if mark and mark.args else choice.pop("scenario", None)
    return make_bench(scenario or request.config.getoption("--bench-scenario"), **choice)
