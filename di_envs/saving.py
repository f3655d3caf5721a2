"""Saves and restores an environment and its wrappers' memory, so that episodes can be branched.

A world's state alone does not make an environment: a time limit counts, a frame stack remembers.
`save` walks the chain from the outermost wrapper to the environment and takes each layer's memory.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium

Wrapped = gymnasium.Env[Any, Any] | gymnasium.vector.VectorEnv[Any, Any, Any]

_WRAPPERS = (gymnasium.Wrapper, gymnasium.vector.VectorWrapper)

# What every wrapper has by being one: structure and spaces, not memory.
_STRUCTURE = frozenset(
    {
        "_single_action_space",
        "_single_observation_space",
        "single_action_space",
        "single_observation_space",
        "env",
        "spec",
        "render_mode",
        "_action_space",
        "_observation_space",
        "_metadata",
        "_cached_spec",
        "_saved_kwargs",
        "action_space",
        "observation_space",
        "metadata",
    }
)


@dataclass(frozen=True, kw_only=True)
class EnvSnapshot:
    """The memory of each layer, outermost wrapper first, the environment itself last."""

    layers: tuple[tuple[str, Any], ...]  # (class name, memory)


def save(env: Wrapped) -> EnvSnapshot:
    """Takes a snapshot of an environment and of the wrappers around it.

    A layer that defines `save_state()` and `restore_state(value)` says itself what its memory is;
    the environment must. Any other wrapper's memory is a deep copy of its own attributes, in which
    references to other layers of the chain are kept as they are.

    Args:
        env: An environment or a `RouteVectorEnv`, wrapped or not, whose innermost layer can save
            itself.

    Returns:
        A value that shares nothing with `env`; it can be restored any number of times.

    Raises:
        TypeError: If the innermost environment, or the memory of a wrapper, cannot be saved.
    """
    chain = list(_layers(env))
    return EnvSnapshot(
        layers=tuple((type(layer).__name__, _saved(layer, chain)) for layer in chain)
    )


def restore(env: Wrapped, snapshot: EnvSnapshot) -> None:
    """Puts an environment and its wrappers back to where they were, or a twin of them there.

    What is seen is a part of it: a snapshot brings along the weather that it was taken in, also
    into an environment made with another `weather=`; `env.unwrapped.change_weather` changes it.

    Args:
        env: The environment that was saved, or one made in the same way.
        snapshot: What `save` returned.

    Raises:
        ValueError: If the layers of `env` are not those of the snapshot, or the towns differ.
    """
    chain = list(_layers(env))
    names = [type(layer).__name__ for layer in chain]
    saved = [name for name, _ in snapshot.layers]
    if names != saved:
        raise ValueError(
            f"The snapshot is of the layers {' > '.join(saved)}, but this environment has "
            f"{' > '.join(names)}. Restore into an environment wrapped in the same way."
        )
    # Innermost first: a wrapper's own restore may then look at the restored environment.
    for layer, (_, memory) in reversed(list(zip(chain, snapshot.layers, strict=True))):
        _put_back(layer, memory, chain)


def _layers(env: Any) -> Iterator[Any]:
    while isinstance(env, _WRAPPERS):
        yield env
        env = env.env
    yield env


def _saves_itself(layer: Any) -> bool:
    # On the class: Gymnasium's wrappers do not forward attributes, and ours must not be fooled.
    return hasattr(type(layer), "save_state") and hasattr(type(layer), "restore_state")


def _saved(layer: Any, chain: list[Any]) -> Any:
    if _saves_itself(layer):
        return layer.save_state()
    if not isinstance(layer, _WRAPPERS):
        raise TypeError(
            f"{type(layer).__name__} cannot be saved: it defines no save_state() and "
            f"restore_state(value), as `RouteEnv` does."
        )
    return _copied(_memory(layer), layer, chain)


def _put_back(layer: Any, memory: Any, chain: list[Any]) -> None:
    if _saves_itself(layer):
        layer.restore_state(memory)
        return
    for name in _memory(layer).keys() - memory.keys():
        delattr(layer, name)
    vars(layer).update(_copied(memory, layer, chain))


def _memory(wrapper: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(wrapper).items() if name not in _STRUCTURE}


def _copied(memory: dict[str, Any], layer: Any, chain: list[Any]) -> dict[str, Any]:
    """A deep copy that stops at the chain's layers and the environment's parts (its world)."""
    kept = {id(part): part for part in (*chain, *vars(chain[-1]).values())}
    try:
        return copy.deepcopy(memory, kept)
    except (TypeError, ValueError, NotImplementedError, copy.Error) as error:
        raise TypeError(
            f"The memory of wrapper {type(layer).__name__} cannot be copied ({error}). Give it "
            f"save_state() -> value and restore_state(value), or save without it."
        ) from error
