"""Jobs: their worlds depend on seed and route alone."""

from __future__ import annotations

import pytest

from leaderboard.running.jobs import Job, plan_jobs

WORLD_SEED_OF_ROUTE_3_SEED_1 = 4280308374  # written down once: a change would change every score


def test_every_route_meets_every_seed_with_routes_outermost():
    jobs = plan_jobs(["a", "b"], [0, 1])
    assert [(job.index, job.route_id, job.seed) for job in jobs] == [
        (0, "a", 0),
        (1, "a", 1),
        (2, "b", 0),
        (3, "b", 1),
    ]


def test_a_world_seed_does_not_depend_on_the_order_of_routes():
    forward = {(job.route_id, job.seed): job.world_seed for job in plan_jobs(["a", "b"], [0, 1])}
    backward = {(job.route_id, job.seed): job.world_seed for job in plan_jobs(["b", "a"], [1, 0])}
    assert forward == backward
    assert len(set(forward.values())) == 4


def test_world_seeds_are_the_same_in_every_process_and_version():
    assert Job(index=0, route_id="3", seed=1).world_seed == WORLD_SEED_OF_ROUTE_3_SEED_1


def test_seed_and_route_do_not_run_together():
    assert (
        Job(index=0, route_id="11", seed=1).world_seed
        != Job(index=0, route_id="1", seed=11).world_seed
    )


@pytest.mark.parametrize(("routes", "seeds"), [([], [0]), (["a"], []), (["a", "a"], [0])])
def test_nothing_to_do_and_the_same_thing_twice_are_refused(routes, seeds):
    with pytest.raises(ValueError, match=r"there is no|given twice"):
        plan_jobs(routes, seeds)
