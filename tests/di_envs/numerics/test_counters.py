"""Whoever takes from a counter gets a number of their own."""

from __future__ import annotations

import threading

import numba
import numpy as np

from di_envs.numerics.counters import take_next

THREADS = 4
LIMIT, TOIL = 200_000, 200  # some 50 ms of work, so that threads are at it side by side


# not cached on disk: its source is this file
@numba.njit(nogil=True)
def take_all(counter, taken):
    toiled = np.uint64(1)
    while True:
        number = take_next(counter)
        if number >= taken.size:
            return toiled
        taken[number] += 1
        for _ in range(TOIL):
            toiled = (toiled ^ (toiled << np.uint64(13))) ^ (toiled >> np.uint64(7))


def test_no_two_threads_get_the_same_number():
    counter, taken = np.zeros(1, np.int32), np.zeros(LIMIT, np.int8)
    take_all(counter, taken[:0])  # compiles
    assert counter[0] == 1
    counter[0] = 0
    together = threading.Barrier(THREADS, timeout=20.0)

    def work():
        together.wait()
        take_all(counter, taken)

    threads = [threading.Thread(target=work) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counter[0] == LIMIT + THREADS  # each found once that none was left
    assert (taken == 1).all()


def test_python_takes_from_it_too():
    counter = np.array([7], np.int32)
    assert [take_next(counter), take_next(counter)] == [7, 8]
    assert counter[0] == 9
