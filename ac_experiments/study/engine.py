"""Plays the runs of a study on Dask: batches sized by time, results written where they are made.

The client hands out stretches of run numbers and hears back how long each took; the rows go from the workers to the
folder of the results. A batch whose worker dies is run again elsewhere, by Dask. Whatever else happens, what has been
written stays, and a study is gone on with where partitions are missing.
"""

import asyncio
import concurrent.futures
import contextlib
import json
import logging
import queue
import signal
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import resource_tracker
from typing import Any

import numpy as np

from ac_common.errors import InterruptedRunError, RunError, UserError, one_line
from ac_common.yaml_file import parsed
from ac_experiments.study.results import MADE_WITH, RUNS, STUDY, TIMING, Store
from ac_experiments.study.schema import Study, check_study, study_yaml

Progress = Callable[[int, int], None]
#: How long a batch should take, s, and how many of them each worker has before it or on the way.
BATCH_S, AHEAD = 15.0, 2
#: A scheduler that cannot be reached for so long is gone, s.
GONE_S = 10.0
_GONE = "the scheduler is gone"
_CANCELLED = (asyncio.CancelledError, concurrent.futures.CancelledError)


@dataclass
class Timing:
    """How a study went: kept apart from its results, which are the same whoever computes them.

    Attributes
    ----------
    runs : int
        Played this time.
    workers : int
        At most at a time.
    wall_s : float
        From the first batch handed out to the last come back.
    busy_s, busy_cpu_s : float
        Seconds in runs, of all workers together; processor time of these.
    client_cpu_s : float
        Processor time of this process meanwhile; with a cluster of its own the scheduler is in it.
    """

    runs: int = 0
    workers: int = 0
    wall_s: float = 0.0
    busy_s: float = 0.0
    busy_cpu_s: float = 0.0
    client_cpu_s: float = 0.0


# ------------------------------------------------------------------------------------------------------ in workers


@lru_cache(maxsize=2)
def _loaded(url: str, identity: str) -> Any:
    """Return the cases of a study, read once a worker."""
    from ac_experiments.study.cases import Cases

    study = check_study(parsed(Store(url).read(STUDY).decode(), STUDY))
    if study.identity != identity:
        msg = f"{url}: {STUDY} is no longer that of the study under way"
        raise RunError(msg)
    return Cases(study)


def play_batch(url: str, identity: str, code: str, first: int, count: int) -> tuple[int, float, float]:
    """Play some runs and write their partition; return how many, the seconds it took, and the processor time.

    Raises
    ------
    RunError
        When this worker has other code than the client, or cannot write.
    UserError
        When a scenario cannot be.
    """
    from ac_common.blas_threads import one_blas_thread
    from ac_experiments.study.runs import made_with, row_of

    one_blas_thread()
    if made_with() != code:
        msg = "a worker has another version of the program, or another plant, than this one"
        raise RunError(msg)
    began, cpu_s = time.perf_counter(), time.process_time()
    cases = _loaded(url, identity)
    study = cases.study
    rows = [row_of(cases[run], study.k0_alone, study.fault_free) for run in range(first, first + count)]
    Store(url).write_part(cases.study, rows)
    return count, time.perf_counter() - began, time.process_time() - cpu_s


# ------------------------------------------------------------------------------------------------------ the client


def begin(study: Study, store: Store, resume: bool) -> None:
    """Put the study into its folder, or see that it is the one that was begun there.

    Raises
    ------
    UserError
        When the folder holds another study, or one that is not to be gone on with.
    """
    from ac_experiments.study.runs import made_with

    if store.has(STUDY):
        if not resume:
            msg = f"{store.url}: holds a study; --resume goes on with it, or choose another --out"
            raise UserError(msg)
        if check_study(parsed(store.read(STUDY).decode(), STUDY)).identity != study.identity:
            msg = f"{store.url}: holds another study than {study.name} as it is now; choose another --out"
            raise UserError(msg)
        if store.read(MADE_WITH).decode().strip() != made_with():
            msg = f"{store.url}: was begun with another version of the program or another plant; choose another --out"
            raise UserError(msg)
        store.sweep()
    else:
        store.write(MADE_WITH, f"{made_with()}\n".encode())
        store.write(STUDY, study_yaml(study).encode())


def run_study(
    study: Study,
    store: Store,
    scheduler: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Timing:
    """Play all runs of a study that are not there yet, and write `runs.parquet`.

    Parameters
    ----------
    study
        As `load_study` gives it.
    store
        Where the results go.
    scheduler
        Address of a Dask scheduler, ``tcp://host:8786``; None: workers of this machine, which end with the study.
    workers
        How many of them; None: one a core.
    resume
        Whether to go on with what is there.
    progress
        Called with the runs done and the runs in all.

    Raises
    ------
    UserError
        When there is nothing to go on with, or a scenario cannot be.
    RunError
        When results cannot be written, or the scheduler is gone: one line; what was done stays.
    InterruptedRunError
        At Ctrl-C; what was done stays.
    """
    begin(study, store, resume)
    timing = Timing()
    missing = store.missing(study.runs)
    if missing:
        again = f"what is done stays in {store.url}, and --resume goes on"
        try:
            with opened_client(scheduler, workers) as client:
                _Dealer(study, store, client, timing, progress).deal(missing)
        except KeyboardInterrupt:
            left = sum(count for _, count in store.missing(study.runs))
            msg = f"interrupted with {study.runs - left} of {study.runs} runs done; {again}"
            raise InterruptedRunError(msg) from None
        except (RunError, OSError, *_CANCELLED) as problem:
            # A connection that breaks while something is asked is an OSError; workers tell of theirs as RunErrors.
            what = problem if isinstance(problem, RunError) else _GONE
            msg = f"{what}; {again}"
            raise RunError(msg) from None
    if missing or not store.has(RUNS):
        store.merge(study)
    if timing.runs:
        store.write(TIMING, (json.dumps(timing.__dict__, indent=2) + "\n").encode())
    return timing


@contextlib.contextmanager
def opened_client(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Give a client of a cluster that exists, or of one on this machine that ends with the block."""
    import dask
    from distributed import Client, LocalCluster

    for name in ("asyncio", "tornado", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("asyncio", "distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what matters is said in one line
    settings = {
        "distributed.comm.timeouts.connect": f"{GONE_S:g}s",
        "distributed.comm.retry.count": 0,
        # Dask watches its own processes all the time, for 3 % of each core; runs that take a second need less of that.
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "500ms",
    }
    with contextlib.ExitStack() as stack, dask.config.set(settings):
        if scheduler is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="acftc-study-", ignore_cleanup_errors=True))
            with _without_interrupts():
                cluster: Any = LocalCluster(
                    n_workers=workers or _cores(),
                    threads_per_worker=1,
                    processes=True,
                    # Dask's dashboard would be shown to nobody; its server is there all the same, and at a fixed port
                    # it would warn whoever has another one running.
                    dashboard_address="127.0.0.1:0",
                    scheduler_kwargs={"dashboard": False},
                    local_directory=folder,
                    memory_limit=None,
                    silence_logs=logging.CRITICAL,
                )
            stack.enter_context(cluster)
        else:
            cluster = scheduler
        try:
            client = stack.enter_context(Client(cluster, set_as_default=False))
        except (OSError, ValueError) as problem:
            msg = f"--scheduler {scheduler}: cannot be reached: {one_line(problem)}"
            raise UserError(msg) from None
        yield client


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Hold back Ctrl-C in threads and processes that are started within the block, for as long as they live.

    A terminal sends it to all processes of a command; ending the workers is the client's to do.
    """
    resource_tracker.ensure_running()  # or the first process that is started would let it in again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cores() -> int:
    import psutil

    return len(psutil.Process().cpu_affinity() or [0])


class _Dealer:
    """Hands out batches, a few ahead of each worker, so that all end together."""

    def __init__(self, study: Study, store: Store, client: Any, timing: Timing, progress: Progress | None) -> None:
        from ac_experiments.study.runs import made_with

        self._study, self._store, self._client, self._timing = study, store, client, timing
        self._progress = progress
        self._code = made_with()
        self._came_back: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._out: dict[Any, tuple[int, int]] = {}
        self._seconds_a_run = np.nan
        self._unreachable_since: float | None = None

    def deal(self, missing: list[tuple[int, int]]) -> None:
        """Have all these stretches of runs played."""
        waiting = deque(missing)
        left = sum(count for _, count in missing)
        done = self._study.runs - left
        self._tell(done)
        cpu_s, began = time.process_time(), time.perf_counter()
        while waiting or self._out:
            self._hand_out(waiting)
            future = self._next()
            if future is None:
                continue
            self._out.pop(future)
            count, seconds, busy_cpu_s = self._result(future)
            future.release()
            done += count
            self._timing.runs += count
            self._timing.busy_s += seconds
            self._timing.busy_cpu_s += busy_cpu_s
            each = seconds / count
            self._seconds_a_run = each if np.isnan(self._seconds_a_run) else 0.7 * self._seconds_a_run + 0.3 * each
            self._tell(done)
        self._timing.wall_s, self._timing.client_cpu_s = time.perf_counter() - began, time.process_time() - cpu_s

    def _hand_out(self, waiting: deque[tuple[int, int]]) -> None:
        """Give each worker what it has to do next."""
        if not waiting:
            return
        workers = len(self._client.nthreads())
        self._timing.workers = max(self._timing.workers, workers)
        while waiting and len(self._out) < AHEAD * max(workers, 1):
            first, there = waiting.popleft()
            left = there + sum(count for _, count in waiting)
            count = min(self._size(left, max(workers, 1)), there)
            if there > count:
                waiting.appendleft((first + count, there - count))
            future = self._client.submit(
                play_batch, self._store.url, self._study.identity, self._code, first, count, pure=False
            )
            self._out[future] = first, count
            future.add_done_callback(self._came_back.put)

    def _size(self, left: int, workers: int) -> int:
        """Return how many runs the next batch has: one until it is known how long that takes, fewer towards the end."""
        if np.isnan(self._seconds_a_run):
            return 1
        share = -(-left // (AHEAD * workers))
        return max(1, min(round(BATCH_S / max(self._seconds_a_run, 1e-6)), -(-share // 2)))

    def _next(self) -> Any:
        """Return a batch that has come back; None after a second without one. A scheduler that is gone is an error."""
        try:
            return self._came_back.get(timeout=1.0)
        except queue.Empty:
            pass
        if self._client.status == "running":
            self._unreachable_since = None
        else:
            self._lost()
        return None

    def _lost(self) -> None:
        now = time.monotonic()
        self._unreachable_since = self._unreachable_since or now
        if self._client.status == "closed" or now - self._unreachable_since > GONE_S:
            msg = _GONE
            raise RunError(msg)

    def _result(self, future: Any) -> tuple[int, float, float]:
        """Return what `play_batch` has returned."""
        from distributed.scheduler import KilledWorker

        if future.status == "cancelled":  # one that is lost, with its worker, is played again
            msg = _GONE
            raise RunError(msg)
        try:
            played: tuple[int, float, float] = future.result()
        except KilledWorker:
            msg = "a batch has ended several workers, perhaps for lack of memory"
            raise RunError(msg) from None
        return played

    def _tell(self, done: int) -> None:
        if self._progress is not None:
            self._progress(done, self._study.runs)
