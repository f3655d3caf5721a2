"""What a model must be shown: groups, rig and LiDAR, read off its observation space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.config import OBSERVATION_GROUPS
from di_envs.files.names import name_hint
from di_envs.observation import observation_space
from di_envs.sensors.camera.config import RIGS
from di_envs.sensors.lidar.config import LIDARS
from di_envs.vectors import vector_space
from di_envs.world.kinds import TICK_S


@dataclass(frozen=True, kw_only=True)
class Senses:
    """What a model reads of an observation.

    Attributes:
        groups: Observation groups that hold it.
        options: Options of the environment that go with them: the rig, the LiDAR.
        entries: Each entry that it reads, with its space in the environment.
        vectors: Names of those that it reads as vectors (`di_envs.vectors`).
    """

    groups: tuple[str, ...]
    options: Mapping[str, Any]
    entries: Mapping[str, spaces.Space[Any]]
    vectors: frozenset[str]


def senses_of(wanted: spaces.Space[Any], told: Mapping[str, Any]) -> Senses:
    """The choice of groups whose observations fit a model's space.

    Args:
        wanted: The model's observation space.
        told: What the model says of itself: `cameras` and `lidar`, where it names them.

    Raises:
        ValueError: If nothing of ours fits; says which entry, what it is, and what we offer.
    """
    if not isinstance(wanted, spaces.Dict):
        raise ValueError(
            f"its observation space is {type(wanted).__name__}, but ours is a Dict of entries: "
            f"train it with MultiInputPolicy."
        )
    entries: dict[str, spaces.Space[Any]] = {}
    groups: list[str] = []
    options: dict[str, Any] = {}
    left = dict(wanted.spaces)
    for group in OBSERVATION_GROUPS:
        names = left.keys() & _names_of(group)
        if not names:
            continue
        option, offered = _fitting(group, {name: left.pop(name) for name in sorted(names)}, told)
        groups.append(group)
        options |= option
        entries |= offered
    if left:
        raise ValueError(_unknown(sorted(left)))
    vectors = (name for name, space in entries.items() if not _alike(wanted[name], space))
    return Senses(
        groups=tuple(groups),
        options=options,
        entries={name: entries[name] for name in wanted.spaces},
        vectors=frozenset(vectors),
    )


def _offers(group: str, told: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], spaces.Dict]]:
    """The forms in which a group comes: options of the environment, and its space with them."""
    presets: dict[str, tuple[str, Mapping[str, Any]]] = {
        "camera": ("cameras", RIGS),
        "lidar": ("lidar", LIDARS),
    }
    if group not in presets:
        yield {}, observation_space((group,))
        return
    option, known = presets[group]
    # at 20 Hz the environment hands out what the LiDAR scans in a tick
    half_sweeps = bool(told.get("control_dt_s") == TICK_S)
    for name in [str(told[option])] if option in told else known:
        rig, lidar = (name, "paper") if group == "camera" else ("small", name)
        yield {option: name}, observation_space((group,), rig, lidar, half_sweeps=half_sweeps)


def _names_of(group: str) -> set[str]:
    return {name for _, space in _offers(group, {}) for name in space.spaces}


def _fitting(
    group: str, wanted: Mapping[str, spaces.Space[Any]], told: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, spaces.Space[Any]]]:
    """The first offer in which every entry of a group fits."""
    complaint = ""
    for option, offer in _offers(group, told):
        wrong = [name for name, space in wanted.items() if not _fits(space, offer.get(name))]
        if not wrong:
            return option, {name: offer[name] for name in wanted}
        name = wrong[0]
        which = " ".join(option.values()) or group
        complaint += f" {which}: {_described(offer.get(name))};"
    raise ValueError(
        f"its observation '{name}' is {_described(wanted[name])}, which none of ours is:"
        f"{complaint} train it on an environment of this version, with a shipped rig or LiDAR, "
        f"and no other wrappers around the observation than VectorObservations."
    )


def _fits(wanted: spaces.Space[Any], offered: spaces.Space[Any] | None) -> bool:
    if offered is None:
        return False
    return _alike(wanted, offered) or _alike(wanted, vector_space(offered))


def _alike(wanted: spaces.Space[Any], offered: spaces.Space[Any]) -> bool:
    """Equal, or an image with its channels first, as Stable-Baselines3 turns them."""
    if wanted == offered:
        return True
    if not (isinstance(offered, spaces.Box) and offered.dtype == np.uint8):
        return False
    if len(offered.shape) != 3:
        return False
    height, width, channels = offered.shape
    return wanted == spaces.Box(0, 255, (channels, height, width), np.uint8)


def _described(space: spaces.Space[Any] | None) -> str:
    """A space in few words: a table's bounds are those of its last row."""
    if not isinstance(space, spaces.Box):
        return str(space)
    low, high = (bound.reshape(-1, bound.shape[-1])[-1][:12] for bound in (space.low, space.high))
    ends = [", ".join(f"{value:.3g}" for value in bound.tolist()) for bound in (low, high)]
    return f"{space.shape} {space.dtype}, a row from [{ends[0]}] to [{ends[1]}]"


def _unknown(names: list[str]) -> str:
    known = [name for group in OBSERVATION_GROUPS for name in sorted(_names_of(group))]
    return f"it reads '{names[0]}', which we do not offer; {name_hint(names[0], known)}."
