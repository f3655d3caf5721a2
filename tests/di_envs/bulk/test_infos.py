"""`info` of many worlds, against what Gymnasium makes of dictionaries of each."""

from __future__ import annotations

import numpy as np
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import VectorEnv

from di_envs.bulk.infos import NUMBERS, Infos, infos_of

TERMS = ("progress", "red_light")


def info_of(world):
    """What a world tells that stands at numbers of its own."""
    return {
        "route_id": f"route {world}",
        "world_seed": 7 + world,
        **dict.fromkeys(NUMBERS, world + 0.5),
        "reward_terms": {"progress": 2.0 * world, "red_light": -1.0},
        "events": (f"event {world}",),
        "finished": "blocked",
    }


def infos_of_three():
    """Three worlds, of which the last two have something of their own to tell."""
    infos = Infos(
        TERMS,
        np.zeros((len(NUMBERS) + len(TERMS), 3)),
        np.array(["a", "b", "c"], object),
        np.array([1, 2, 3]),
    )
    for world in (1, 2):
        infos.put(world, info_of(world))
    return infos


def gymnasiums(infos):
    """As `VectorEnv` batches dictionaries."""
    env = VectorEnv()
    env.num_envs = 3
    batched = {}
    for world, info in enumerate(infos):
        batched = env._add_info(batched, info, world)
    return batched


def test_a_world_of_which_nothing_was_said_has_zeros_and_no_events():
    row = infos_of_three().row(0)
    assert row == {
        "route_id": "a",
        "world_seed": 1,
        **dict.fromkeys(NUMBERS, 0.0),
        "reward_terms": {"progress": 0.0, "red_light": 0.0},
        "events": (),
        "finished": "",
    }
    assert type(row["world_seed"]) is int
    assert type(row["driving_score"]) is float


def test_what_was_put_in_comes_out():
    assert infos_of_three().row(2) == info_of(2)


def test_all_together_are_what_gymnasium_makes_of_them():
    infos = infos_of_three()
    rows = [infos.row(world) for world in range(3)]
    assert data_equivalence(infos.batched(), gymnasiums(rows), exact=True)


def test_worlds_that_were_reset_are_too_whether_all_or_some():
    begun = {world: info_of(world) for world in range(3)}
    found = infos_of(begun, 3, VectorEnv()._add_info)
    assert data_equivalence(found, gymnasiums(list(begun.values())), exact=True)
