"""Hashes change with every bit seen, earned or caused, and with nothing else."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis.strategies import floats

from di_envs.world.state import EventKind
from di_envs.world.world import Event
from leaderboard.records.episode_hash import EpisodeHash


def observed(*observations: dict[str, object]) -> str:
    hashes = EpisodeHash()
    for observation in observations:
        hashes.add_observation(observation)
    return hashes.hex()[0]


def test_one_changed_bit_of_one_array_changes_the_hash():
    array = np.zeros((4, 3), dtype=np.float32)
    changed = array.copy()
    changed[2, 1] = np.nextafter(np.float32(0.0), np.float32(1.0))
    assert observed({"map": array, "command": 3}) == observed({"map": array.copy(), "command": 3})
    assert observed({"map": array, "command": 3}) != observed({"map": changed, "command": 3})
    assert observed({"map": array, "command": 3}) != observed({"map": array, "command": 4})


def test_the_layout_in_memory_does_not_matter_and_the_order_of_steps_does():
    array = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert observed({"a": array}) == observed({"a": np.asfortranarray(array)})
    other = array + 1
    assert observed({"a": array}, {"a": other}) != observed({"a": other}, {"a": array})


@given(floats(allow_nan=False), floats(allow_nan=False))
def test_rewards_are_hashed_by_their_bits(first, second):
    one, two = EpisodeHash(), EpisodeHash()
    one.add_reward(first)
    two.add_reward(second)
    same = np.float64(first).tobytes() == np.float64(second).tobytes()
    assert (one.hex()[1] == two.hex()[1]) == same


def test_an_event_counts_with_its_time_place_and_cause():
    event = {"kind": EventKind.RED_LIGHT, "ego": 0, "tick": 7, "x": 1.0, "y": 2.0, "z": 0.0}
    changes = [{}, {"tick": 8}, {"x": 1.5}, {"other": 4}, {"value": 2.0}]
    seen = set()
    for change in changes:
        hashes = EpisodeHash()
        hashes.add_events([Event(**{**event, **change})])
        seen.add(hashes.hex()[2])
    assert len(seen) == len(changes)
