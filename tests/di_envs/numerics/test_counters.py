"""Whoever takes from a counter gets a number of their own."""

from __future__ import annotations

import threading

import numba
import numpy as np

from di_envs.numerics.counters import take_next

THREADS, LIMIT = 4, 200_000


# not cached on disk: its source is this file
@numba.njit(nogil=True)
def take_all(counter, taken, who):
    while True:
        number = take_next(counter)
        if number >= taken.size:
            return
        taken[number] += 1 + who


def test_no_two_threads_get_the_same_number():
    counter, taken = np.zeros(1, np.int32), np.zeros(LIMIT, np.int64)
    take_all(counter, taken[:0], 0)  # compiles
    assert counter[0] == 1
    counter[0] = 0
    threads = [
        threading.Thread(target=take_all, args=(counter, taken, 10**index))
        for index in range(THREADS)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counter[0] == LIMIT + THREADS  # each found once that none was left
    assert set(np.unique(taken).tolist()) <= {1 + 10**index for index in range(THREADS)}


def test_python_takes_from_it_too():
    counter = np.array([7], np.int32)
    assert [take_next(counter), take_next(counter)] == [7, 8]
    assert counter[0] == 9
