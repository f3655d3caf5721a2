"""What follows from a town alone is worked out once, and never taken for another town's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from di_envs.town.loading import load_town
from di_envs.town.map_chunks import map_chunks_of
from di_envs.town.once import KEPT, once_a_town


def counted():
    """A function of a town, and the towns that it was called with."""
    calls = []

    @once_a_town
    def widest(town):
        calls.append(town)
        return float(town.lanes.width_m.max())

    return widest, calls


def test_it_is_worked_out_once_for_equal_towns():
    widest, calls = counted()
    first = load_town("toy")
    again = replace(first, lanes=first.lanes._replace(width_m=first.lanes.width_m.copy()))
    assert widest(first) == widest(again) == widest(first)
    assert len(calls) == 1


def test_a_town_that_was_changed_under_the_same_hash_is_another():
    widest, calls = counted()
    town = load_town("toy")
    wider = replace(town, lanes=town.lanes._replace(width_m=town.lanes.width_m + 1.0))
    assert widest(wider) == widest(town) + 1.0
    assert len(calls) == 2


def test_only_the_last_towns_are_kept():
    widest, calls = counted()
    towns = [replace(load_town("toy"), content_hash=str(number)) for number in range(KEPT + 1)]
    for town in towns:
        widest(town)
    widest(towns[-KEPT])
    assert len(calls) == KEPT + 1
    widest(towns[0])
    assert len(calls) == KEPT + 2


def test_a_worlds_map_is_shared_by_all_who_look_at_it():
    chunks = map_chunks_of(load_town("toy"))
    assert np.shares_memory(chunks.points, map_chunks_of(load_town("toy")).points)
