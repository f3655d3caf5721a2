"""Who drives what, with workers that are made up: no process is started."""

from __future__ import annotations

from collections import deque

import pytest

from agents.base import Requirements
from leaderboard.records.record import WORKER_DIED
from leaderboard.running.jobs import Job, SetupError, plan_jobs
from leaderboard.running.log import lost_record
from leaderboard.running.messages import Died, Driven, Lost, Pause, Ready, Refused, Scene, Started
from leaderboard.running.workers.scheduler import Scheduler

SCENE = Scene(
    requires=Requirements(),
    agent_version="ab",
    town="toy",
    town_hash="cd",
    route_ids=("0",),
    routes_hash="ef",
    versions={},
    cpu="generic",
)
DEATH = Died(status=WORKER_DIED, reason="it was its time")


class Crew:
    """Workers are numbers; each message is told one round after what it answers.

    Attributes:
        scenes: What each worker was hired with.
        most: Workers that lived at the same time.
    """

    def __init__(self, *, deadly=(), never_ready=(), first=None):
        self.deadly, self.never_ready, self.first = set(deadly), set(never_ready), first
        self.scenes, self.alive, self.told, self.checked, self.most = [], set(), [], [], 0

    def hire(self, scene):
        worker = len(self.scenes)
        self.scenes.append(scene)
        self.alive.add(worker)
        self.most = max(self.most, len(self.alive))
        message = DEATH if worker in self.never_ready else Ready(scene=SCENE)
        self.told.append((worker, self.first if self.first and worker == 0 else message))
        return worker

    def hand_over(self, worker, job):
        assert worker in self.alive
        if job.seed in self.deadly:
            self.deadly.discard(job.seed)  # once
            self.told.append((worker, DEATH))
        else:
            self.told.append((worker, Driven(job=job, record=lost_record(job, ""))))

    def listen(self, workers):
        assert set(workers) == self.alive
        told, self.told = self.told[:1], self.told[1:]
        return told

    def check(self, first, other):
        self.checked.append(other)

    def dismiss(self, worker):
        self.alive.remove(worker)


def scheduled(crew: Crew, workers: int, seeds: range, again: bool = True):
    """The events of a run whose caller queues a lost job once more, as the runner does."""
    jobs: deque[Job] = deque()
    events = []
    for event in Scheduler(crew, workers, jobs).run():
        events.append(event)
        if isinstance(event, Ready):
            jobs.extend(plan_jobs(event.scene.route_ids, seeds))
        if isinstance(event, Lost) and again:
            jobs.append(event.job)
    return events


def of(kind, events):
    return [event.job.seed for event in events if isinstance(event, kind)]


def test_all_jobs_are_driven_in_order_by_one_worker():
    crew = Crew()
    events = scheduled(crew, 1, range(4))
    assert of(Started, events) == of(Driven, events) == [0, 1, 2, 3]
    assert crew.scenes == [None]
    assert not crew.alive


def test_no_more_workers_are_hired_than_there_are_jobs_or_may_be():
    for workers, jobs in ((3, 10), (10, 3)):
        crew = Crew()
        events = scheduled(crew, workers, range(jobs))
        assert sorted(of(Driven, events)) == list(range(jobs))
        assert len(crew.scenes) == crew.most == 3
        assert crew.scenes == [None, SCENE, SCENE]  # the first finds it out
        assert sum(isinstance(event, Ready) for event in events) == 1


def test_a_worker_gets_no_job_before_it_is_ready():
    """One that never is takes none along: the others drive them all."""
    crew = Crew(never_ready=(1,))
    events = scheduled(crew, 2, range(6))
    assert of(Lost, events) == []
    assert sorted(of(Driven, events)) == list(range(6))


def test_a_job_that_takes_its_worker_along_is_told_as_lost_and_another_worker_comes():
    crew = Crew(deadly=(1,))
    events = scheduled(crew, 1, range(3))
    assert of(Lost, events) == [1]
    assert of(Driven, events) == [0, 2, 1]
    assert len(crew.scenes) == 2


def test_the_run_is_over_only_when_what_the_caller_added_last_is_driven():
    crew = Crew(deadly=(2,))
    events = scheduled(crew, 1, range(3))
    assert of(Driven, events) == [0, 1, 2]
    assert of(Lost, scheduled(Crew(deadly=(2,)), 1, range(3), again=False)) == [2]


def test_where_no_worker_gets_ready_the_run_ends_and_says_why():
    with pytest.raises(SetupError, match="cannot be set up: it was its time"):
        scheduled(Crew(never_ready=(0,)), 2, range(3))
    crew = Crew(never_ready=range(1, 100))
    with pytest.raises(SetupError, match="cannot be set up: it was its time"):
        scheduled(crew, 2, range(1000))
    assert len(crew.scenes) == 1 + 6
    assert not crew.alive


def test_a_refusal_ends_the_run_with_its_reason():
    crew = Crew(first=Refused(reason="there is no such town"))
    with pytest.raises(SetupError, match="no such town"):
        scheduled(crew, 2, range(3))
    assert not crew.alive


def test_every_worker_is_compared_with_the_first_one():
    crew = Crew()
    scheduled(crew, 3, range(9))
    assert crew.checked == [SCENE, SCENE, SCENE]


def test_a_run_that_is_left_ends_all_its_workers():
    crew, jobs = Crew(), deque[Job]()
    events = Scheduler(crew, 2, jobs).run()
    assert isinstance(next(events), Ready)
    jobs.extend(plan_jobs(["0"], range(5)))
    while len(crew.alive) < 2:
        next(events)
    events.close()
    assert not crew.alive


def test_where_nothing_is_told_it_says_so_that_the_run_can_be_stopped():
    crew = Crew()
    events = Scheduler(crew, 1, deque()).run()
    crew.listen = lambda workers: []
    assert isinstance(next(events), Pause)
    events.close()
