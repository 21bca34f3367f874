"""Arms carried out by the workers of dask.distributed: a cluster of this machine, or an existing one by its address.

The client keeps each result as it arrives. A worker that dies loses the arm it was at, which another does again; a run that
dies is taken up where it was, by running it again.
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
PATIENCE_S = 10.0
TRIES = 3  # workers that an arm may take down with it before it counts as failed


class NoCluster(UserError, ValueError):
    """There is nothing to carry the arms out on."""


@dataclass(slots=True)
class Tally:
    """How far the work is: arms in all, done before this run, done now, and the reasons of those that failed."""

    total: int
    before: int = 0
    done: int = 0
    failures: dict[str, str] = field(default_factory=dict)

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
    told: Callable[[Tally], None] = lambda _: None,
) -> Tally:
    """Do the arms that the store does not hold yet. work: importable where the workers are.

    An arm that raises, or takes workers down with it, is a failure of its own and is tried again by the next run.
    """
    waiting = {key: arm for key, arm in arms.items() if key not in store}
    tally = Tally(len(arms), before=len(arms) - len(waiting))
    told(tally)
    if waiting:
        with client_of(scheduler, min(workers or os.cpu_count() or 1, len(waiting))) as client:
            _drain(client, work, waiting, store, tally, told)
    return tally


def _drain(
    client: "Client",
    work: Callable[[T], Row],
    waiting: Mapping[str, T],
    store: Store,
    tally: Tally,
    told: Callable[[Tally], None],
) -> None:
    """One arm for each thread there is, and another for each that ends: an arm that waits behind one which kills its worker
    would be blamed with it.
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
            store.keep(key, row)  # a disk that is full ends the work: no other arm will find it better
            tally.done += 1
        told(tally)
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
                memory_limit=None,
                silence_logs=50,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
