"""Signals while a run is under way: noted once, obeyed at once the second time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import pytest

from leaderboard.running.interruption import SIGNALS, interruptible

TWICE = """
import os, signal
from leaderboard.running.interruption import interruptible
with interruptible(ends_process=True) as interruption:
    os.kill(os.getpid(), signal.SIGTERM)
    print(interruption.requested, flush=True)
    os.kill(os.getpid(), signal.SIGINT)
    print("never")
"""


FROM_PYTHON = """
import os, signal
from leaderboard.running.interruption import interruptible
try:
    with interruptible():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        print("never")
except KeyboardInterrupt:
    print("the host lives", flush=True)
"""


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_noted_and_handlers_are_put_back(number):
    before = signal.getsignal(number)
    with interruptible() as interruption:
        assert not interruption.requested
        os.kill(os.getpid(), number)
        assert interruption.requested
    assert signal.getsignal(number) == before


def test_a_second_signal_ends_the_process():
    done = subprocess.run([sys.executable, "-c", TWICE], capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (128 + signal.SIGINT, b"True\n")


def test_a_second_signal_leaves_a_process_that_called_us_alive():
    done = subprocess.run([sys.executable, "-c", FROM_PYTHON], capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (0, b"the host lives\n")


def test_in_another_thread_nothing_is_touched():
    before = signal.getsignal(signal.SIGINT)
    found = []

    def run() -> None:
        with interruptible() as interruption:
            found.append((interruption.requested, signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [(False, before)]
