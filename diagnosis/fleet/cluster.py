"""Runs many arms (independent jobs) on dask.distributed: on processes of this machine, or on an existing cluster by its address.

The client stores each result as it arrives. If a worker dies, another repeats its arm. If the run itself dies, starting it again continues
where it ended.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, TypeVar

from bus.user_error import UserError
from diagnosis.fleet.store import Row, Store

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")

LOOPBACK = "127.0.0.1"
PATIENCE_S = 10.0  # to connect to a scheduler
TRIES = 3  # workers that may die at one arm before it counts as failed; less would blame an arm for another's crash


class NoCluster(UserError, ValueError):
    """There is no cluster to run the arms on."""


@dataclass(slots=True)
class Tally:
    """Progress of the work, in arms."""

    total: int
    before: int = 0  # finished by an earlier run
    done: int = 0  # finished by this run
    failures: dict[str, str] = field(default_factory=dict)  # reason by key

    @property
    def left(self) -> int:
        return self.total - self.before - self.done - len(self.failures)


def carry_out(
    work: Callable[[T], Row],
    arms: Mapping[str, T],
    store: Store,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    report: Callable[[Tally], None] = lambda _: None,
) -> Tally:
    """Run the arms that the store does not contain yet. work: importable by the workers; report: called after each arm.

    An arm that raises, or at which workers die, fails alone; the next run tries it again.
    """
    waiting = {key: arm for key, arm in arms.items() if key not in store}
    tally = Tally(len(arms), before=len(arms) - len(waiting))
    report(tally)
    if waiting:
        with client_of(scheduler, min(workers or os.cpu_count() or 1, len(waiting))) as client:
            _drain(client, work, waiting, store, tally, report)
    return tally


def _drain(
    client: "Client",
    work: Callable[[T], Row],
    waiting: Mapping[str, T],
    store: Store,
    tally: Tally,
    report: Callable[[Tally], None],
) -> None:
    """Run all waiting arms, never more than one per thread.

    Dask counts a dead worker against every arm that waits at it. Arms that wait here instead, at the client, are not blamed.
    """
    from distributed import as_completed

    ahead = iter(waiting.items())
    keys: dict[Future[Row], str] = {}
    running = as_completed()

    def fill() -> None:
        free = max(sum(client.nthreads().values()), 1) - len(keys)
        for key, arm in islice(ahead, max(free, 0)):
            future = client.submit(work, arm, pure=False)
            keys[future] = key
            running.add(future)

    fill()
    for future in running:
        key = keys.pop(future)
        try:
            row = future.result()
        except Exception as error:
            tally.failures[key] = f"{type(error).__name__}: {error}".splitlines()[0]
        else:
            store.keep(
                key, row
            )  # an error here, such as a full disk, ends the run: it would meet every other arm too
            tally.done += 1
        report(tally)
        fill()


@contextmanager
def client_of(scheduler: str | None, workers: int) -> Iterator["Client"]:
    """A client of the scheduler at that address, or of as many processes of this machine, which end with it."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise NoCluster("many arms need dask.distributed: pip install 'loaderhil[scale]'") from error
    with dask.config.set({"distributed.scheduler.allowed-failures": TRIES - 1}):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=PATIENCE_S)
            except (OSError, TimeoutError, ValueError) as error:
                raise NoCluster(f"--scheduler {scheduler}: no scheduler answers there: {error}") from error
            with client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",  # any free port: several clusters may run
                memory_limit=None,  # dask would pause or kill workers by its own guess of their memory
                silence_logs=50,  # CRITICAL: failures are reported by the table
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
