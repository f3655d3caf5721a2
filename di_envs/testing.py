"""Conformance checks to run on an environment of your own: your map, your options, your wrappers.

`check_environment(lambda: gymnasium.make("DriveInsight-Toy-v1", control_dt_s=0.05))` raises
`AssertionError` with the reason, or returns nothing. All drive with actions keyed by the seed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np

from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.saving import restore, save

Environment = gymnasium.Env[Any, Any]


def check_environment(make: Callable[[], Environment], *, seed: int = 0, steps: int = 50) -> None:
    """Runs every check of this module.

    Args:
        make: Makes the environment, wrapped or not; called twice.
        seed: Of the episodes driven.
        steps: How many steps each check drives.

    Raises:
        AssertionError: If the environment breaks a promise; says which.
    """
    env, twin = make(), make()
    try:
        check_spaces(env, seed=seed, steps=steps)
        check_determinism(env, twin, seed=seed, steps=steps)
        check_save_restore(env, twin, seed=seed, steps=steps)
    finally:
        env.close()
        twin.close()


def check_spaces(env: Environment, *, seed: int = 0, steps: int = 50) -> None:
    """Every observation lies in the space, holds no NaN, and shares no array with the last one."""
    observation, _ = env.reset(seed=seed)
    _check_observation(env, observation, "reset")
    for step in range(steps):
        last = observation
        observation, _, terminated, truncated, _ = env.step(keyed_action(env, seed, step))
        _check_observation(env, observation, f"step {step}")
        for name, value in _items(observation):
            if isinstance(value, np.ndarray):
                shared = np.shares_memory(value, dict(_items(last))[name])
                _hold(not shared, f"step {step}: '{name}' is the array of the step before")
        if terminated or truncated:
            observation, _ = env.reset()


def check_determinism(
    env: Environment, twin: Environment, *, seed: int = 0, steps: int = 50
) -> None:
    """Equal seeds give equal bits: in a twin, and after another episode was driven."""
    first = drive(env, seed, steps)
    _hold(drive(twin, seed, steps) == first, "a twin of equal seed gave other bits")
    drive(env, seed + 1, steps)
    _hold(drive(env, seed, steps) == first, "another episode in between changed this one")


def check_save_restore(
    env: Environment, twin: Environment, *, seed: int = 0, steps: int = 50
) -> None:
    """From a snapshot, the same actions give the same bits, here and in a twin, again and again."""
    drive(env, seed, steps // 2)
    snapshot = save(env)
    first = drive(env, seed, steps, begin=False)
    drive(env, seed + 1, steps)
    restore(env, snapshot)
    again = drive(env, seed, steps, begin=False)
    _hold(again == first, "a restored episode went another way")
    twin.reset(seed=seed + 2)
    restore(twin, snapshot)
    there = drive(twin, seed, steps, begin=False)
    _hold(there == first, "a twin went another way from a snapshot")


def drive(env: Environment, seed: int, steps: int, *, begin: bool = True) -> str:
    """Drives with keyed actions, and gives a hash of all that the environment returned.

    Args:
        env: The environment.
        seed: Of the episode and of the actions.
        steps: How many steps; over when the episode is.
        begin: Whether to reset first.
    """
    digest = hashlib.blake2b(digest_size=16)
    if begin:
        _add(digest, env.reset(seed=seed))
    for step in range(steps):
        result = env.step(keyed_action(env, seed, step))
        _add(digest, result)
        if result[2] or result[3]:
            break
    return digest.hexdigest()


def keyed_action(env: Environment, seed: int, step: int) -> np.ndarray[Any, Any]:
    """An action within the Box of the environment, a function of seed and step alone."""
    space = env.action_space
    if not isinstance(space, gymnasium.spaces.Box):
        raise AssertionError(f"expected a Box of actions, got {space}")
    draws = [uniform(seed, int(Stream.AGENT), step, k) for k in range(int(np.prod(space.shape)))]
    action = space.low + np.reshape(draws, space.shape) * (space.high - space.low)
    return action.astype(space.dtype)


def _items(observation: Any) -> list[tuple[str, Any]]:
    """Named entries of an observation; one without names is a single entry."""
    return list(observation.items() if isinstance(observation, Mapping) else [("", observation)])


def _check_observation(env: Environment, observation: Any, when: str) -> None:
    _hold(observation in env.observation_space, f"{when}: the observation is not in its space")
    for name, value in _items(observation):
        _hold(bool(np.isfinite(value).all()), f"{when}: '{name}' holds NaN or infinity")


def _hold(promise: bool, broken: str) -> None:
    """Raises where a promise is not kept; `assert` would be left out by `python -O`."""
    if not promise:
        raise AssertionError(broken)


def _add(digest: Any, value: Any) -> None:
    """Feeds a value of any kind to a hash: bits of arrays, names of keys, `repr` of the rest."""
    if isinstance(value, Mapping):
        for key in sorted(value):
            digest.update(str(key).encode())
            _add(digest, value[key])
    elif isinstance(value, tuple | list):
        for part in value:
            _add(digest, part)
    elif isinstance(value, np.ndarray):
        digest.update(value.tobytes())
    else:
        digest.update(repr(value).encode())
