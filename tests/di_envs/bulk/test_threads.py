"""Threads that share out work."""

from __future__ import annotations

import gc
import threading

import pytest
from gymnasium.error import ClosedEnvironmentError

from di_envs.bulk.threads import Crew


@pytest.mark.parametrize("threads", [1, 3])
def test_every_job_is_done_once(threads):
    done = [0] * 50
    crew = Crew(threads)

    def job(index):
        done[index] += 1

    crew.each([lambda index=index: job(index) for index in range(50)])
    assert done == [1] * 50
    crew.close()


def test_two_jobs_run_side_by_side():
    both = threading.Barrier(2, timeout=20.0)
    crew = Crew(2)
    crew.each([both.wait, both.wait])  # one after the other would wait for ever
    crew.close()


def test_what_a_job_raises_comes_out_once_the_others_are_done():
    done = []
    crew = Crew(2)

    def fail():
        raise ValueError("this one")

    with pytest.raises(ValueError, match="this one"):
        crew.each([fail, *(lambda index=index: done.append(index) for index in range(20))])
    assert sorted(done) == list(range(20))
    crew.close()


def test_interrupted_it_does_the_next_jobs_whole():
    crew, release, late = Crew(2), threading.Event(), []

    def wait():
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        release.wait(20.0)
        late.append(1)

    threading.Timer(0.2, release.set).start()
    with pytest.raises(KeyboardInterrupt):
        crew.each([wait, wait])
    done = []
    crew.each([lambda index=index: done.append(index) for index in range(20)])
    assert sorted(done) == list(range(20))
    crew.close()


@pytest.mark.parametrize("let_go", [Crew.close, lambda _crew: None], ids=["closed", "dropped"])
def test_its_threads_end_with_it(let_go):
    before = set(threading.enumerate())
    crew = Crew(3)
    crew.each([threading.Barrier(3, timeout=20.0).wait] * 3)
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 2
    let_go(crew)
    del crew
    gc.collect()
    for helper in helpers:
        helper.join(timeout=20.0)
        assert not helper.is_alive()


def test_a_closed_crew_works_no_more():
    crew = Crew(2)
    crew.close()
    with pytest.raises(ClosedEnvironmentError, match="make another"):
        crew.each([])
