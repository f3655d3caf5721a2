"""Work in processes of this machine: fresh ones, that leave Ctrl-C to their parent and end with it.

Whoever spreads work over processes does it here, so that one rule holds for all. A child is born
with Ctrl-C and Ctrl-\\ blocked, takes no module from the working folder, and ends with its parent:
one that is killed, even by a signal that nobody can catch, leaves no child behind. On Linux the
system sees to that, elsewhere a thread that watches a pipe. This lies in `agents`, the lowest room
that starts processes; the leaderboard's workers and pools use it from above.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing.connection import wait
from typing import Any, Protocol, TypeVar

from agents.import_folders import without_agents
from di_envs.files.caches import CacheWarning

_PR_SET_PDEATHSIG, _PR_SET_DUMPABLE = 1, 4  # of Linux's prctl
_SAFE_PATH = "PYTHONSAFEPATH"  # the variable of Python that leaves out the working folder
_FROM_TERMINAL = tuple(  # Windows has no SIGQUIT
    getattr(signal, name) for name in ("SIGINT", "SIGQUIT") if hasattr(signal, name)
)
FRESH = multiprocessing.get_context("spawn")  # how they begin: with nothing of their parent's

J = TypeVar("J")
R = TypeVar("R")
Given = TypeVar("Given", covariant=True)


class Pending(Protocol[Given]):
    """A job that is on its way, as `concurrent.futures.Future` has it."""

    def result(self) -> Given: ...
    def cancel(self) -> bool: ...


class Pool(Protocol[J, R]):
    """Whatever does jobs at the same time: processes here, or a cluster."""

    def submit(self, work: Callable[[J], R], job: J, /) -> Pending[R]: ...


@contextmanager
def processes(workers: int) -> Iterator[Pool[Any, Any]]:
    """A pool of so many processes of this machine, which start as there is work for them."""
    with births():  # the one that tidies up shared memory begins with the pool's queues
        executor = ProcessPoolExecutor(workers, FRESH, live_for_parent)
    with executor:
        yield _Processes(executor)


class _Processes:
    """An executor whose children are born with Ctrl-C blocked."""

    def __init__(self, executor: ProcessPoolExecutor) -> None:
        self._executor = executor

    def submit(self, work: Callable[[J], R], job: J, /) -> Pending[R]:
        with births():
            return self._executor.submit(work, job)


def in_order(
    pool: Pool[J, R],
    work: Callable[[J], R],
    jobs: Iterable[J],
    *,
    ahead: int,
    in_vain: Callable[[R], None] | None = None,
) -> Generator[R, None, None]:
    """Does jobs at the same time; yields what comes of them in their own order.

    It may be left at any time (`close`): what has not begun then is never done.

    Args:
        pool: Where.
        work: What is done with a job: a function of a module, as processes find it by its name.
        jobs: Asked for one more whenever one has been yielded; there may be no end to them.
        ahead: How many are under way at most, counting the one that is waited for.
        in_vain: Told the results that nobody waited for when this was left, to undo them. What
            went wrong in such a job is passed over: with one process it would not have begun.

    Raises:
        ChildProcessError: If a process died.
        Exception: What a job raised, with the trace of its process as the cause.
    """
    left = iter(jobs)
    under_way = deque(pool.submit(work, job) for job in islice(left, ahead))
    try:
        while under_way:
            yield _result(under_way.popleft())
            under_way.extend(pool.submit(work, job) for job in islice(left, 1))
    finally:
        begun = [pending for pending in under_way if not pending.cancel()]
        if in_vain is not None:
            for result in _results(begun):
                in_vain(result)


def _results(begun: Iterable[Pending[R]]) -> Iterator[R]:
    """Those of the jobs that went well."""
    for pending in begun:
        try:
            result = _result(pending)
        except Exception:
            continue
        yield result


def _result(pending: Pending[R]) -> R:
    try:
        return pending.result()
    except BrokenProcessPool as error:
        raise ChildProcessError(
            "a process that worked for this one died: it was killed, or there was no memory left; "
            "with fewer --workers each has more"
        ) from error


@contextmanager
def births() -> Iterator[None]:
    """Processes born within are born as they should be, whoever starts them.

    They never die of Ctrl-C, or Ctrl-\\, not even while they load; Windows has no such masks. And
    they load Python's own modules, not a `multiprocessing.py` of the working folder, which comes
    first for a fresh process: it may be a folder that somebody sent. For the same reason they know
    nothing of the folders of agents that were loaded here.
    """
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _FROM_TERMINAL) if masks else ()
    said = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        with without_agents():
            yield
    finally:
        os.environ.pop(_SAFE_PATH, None)
        if said is not None:
            os.environ[_SAFE_PATH] = said
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def keep_others_out() -> None:
    """From now on no other process of the same user can look into this one, or trace it.

    On Linux; root still can, and there are no core dumps any more.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_DUMPABLE, 0)


def _end_with_parent() -> None:
    """In a child: the system kills it as its parent ends, even if its code holds Python's lock.

    On Linux; elsewhere `live_for_parent` has to do.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    parent = multiprocessing.parent_process()
    if parent is not None and os.getppid() != parent.pid:
        os._exit(1)  # it ended before it was said


def how_it_ended(exitcode: int | None) -> str:
    """What became of a process that is no more, as the end of a sentence."""
    if exitcode is not None and exitcode < 0:
        return f"was killed by {_signal_name(-exitcode)}"
    return f"ended by itself with exit code {exitcode}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # of those for real time only the first and the last have names
        return f"signal {number}"


def leave_warnings_to_parent() -> None:
    """In a child: says nothing of caches, which its parent has said already."""
    warnings.filterwarnings("ignore", category=CacheWarning)


def live_for_parent() -> None:
    """In a child: leaves Ctrl-C to the parent, and has the child end when the parent does."""
    os.environ.pop(_SAFE_PATH, None)  # it was for the birth, not for what is started here
    for number in _FROM_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    leave_warnings_to_parent()
    _end_with_parent()
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    sentinel = parent.sentinel

    def watch() -> None:
        wait([sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
