"""What a model must be shown: groups, rig, LiDAR and preset, read off its observation space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from agents.sb3.one_vector import Senses, described, vector_senses
from di_envs.config import OBSERVATION_GROUPS
from di_envs.files.names import name_hint
from di_envs.observation import observation_space
from di_envs.presets import as_box, box_space
from di_envs.sensors.camera.config import RIGS
from di_envs.sensors.lidar.config import LIDARS
from di_envs.vectors import as_vector, vector_space
from di_envs.world.kinds import TICK_S


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """One entry of an observation, and how a model reads it: as a Box, as a vector, as both."""

    space: spaces.Space[Any]  # as the environment has it
    boxed: bool
    vector: bool

    def read(self, value: Any) -> Any:
        """What the model takes."""
        space = self.space
        if self.boxed:
            value, space = as_box(value, space), box_space(space)
        return as_vector(value, space) if self.vector else value

    @property
    def read_space(self) -> spaces.Space[Any]:
        """The space of `read`."""
        space = box_space(self.space) if self.boxed else self.space
        return vector_space(space) if self.vector else space


def senses_of(wanted: spaces.Space[Any], told: Mapping[str, Any]) -> Senses:
    """The choice of groups whose observations fit a model's space.

    Args:
        wanted: The model's observation space.
        told: What the model says of itself: `cameras`, `lidar` and `preset`, where it names them.

    Raises:
        ValueError: If nothing of ours fits, or what the model says is not what its space is; says
            which entry, what it is, and what we offer.
    """
    if isinstance(wanted, spaces.Box) and len(wanted.shape) == 1:
        senses, either = vector_senses(wanted), False
    elif isinstance(wanted, spaces.Dict):
        senses, either = _dict_senses(wanted, told)
    else:
        raise ValueError(
            f"its observation space is {wanted}, but ours is a Dict of entries or, with "
            f"preset='flat', one vector: train it on one of these."
        )
    said = str(told.get("preset", senses.preset))
    if said != senses.preset and not (either and said == "box"):
        raise ValueError(
            f"it says that it was trained with preset={said!r}, but its observation space is that "
            f"of preset={senses.preset or None!r}: correct what it says, or train it on that."
        )
    return Senses(groups=senses.groups, options=senses.options, preset=said, see=senses.see)


def _dict_senses(wanted: spaces.Dict, told: Mapping[str, Any]) -> tuple[Senses, bool]:
    """What a model of named entries reads, and whether they are the same with preset `box`."""
    entries: dict[str, _Entry] = {}
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

    def see(observation: Mapping[str, Any]) -> dict[str, Any]:
        return {name: entries[name].read(observation[name]) for name in wanted.spaces}

    preset = "box" if any(entry.boxed for entry in entries.values()) else ""
    alike = all(entry.boxed or box_space(entry.space) == entry.space for entry in entries.values())
    senses = Senses(groups=tuple(groups), options=options, preset=preset, see=see)
    return senses, alike


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
) -> tuple[dict[str, Any], dict[str, _Entry]]:
    """The first offer in which every entry of a group fits."""
    complaint = ""
    for option, offer in _offers(group, told):
        found = {name: _entry(space, offer.get(name)) for name, space in wanted.items()}
        fitting = {name: entry for name, entry in found.items() if entry is not None}
        if len(fitting) == len(found):
            return option, fitting
        name = next(name for name in found if name not in fitting)
        which = " ".join(option.values()) or group
        complaint += f" {which}: {described(offer.get(name))};"
    raise ValueError(
        f"its observation '{name}' is {described(wanted[name])}, which none of ours is:"
        f"{complaint} train it on an environment of this version, with a shipped rig or LiDAR, "
        f"with or without preset='box', and no other wrappers around the observation than "
        f"VectorObservations."
    )


def _entry(wanted: spaces.Space[Any], offered: spaces.Space[Any] | None) -> _Entry | None:
    """How an entry must be read to fit a model, the plainest way first; None if it cannot."""
    if offered is None:
        return None
    for boxed, vector in ((False, False), (False, True), (True, False), (True, True)):
        entry = _Entry(space=offered, boxed=boxed, vector=vector)
        if _alike(wanted, entry.read_space):
            return entry
    return None


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


def _unknown(names: list[str]) -> str:
    known = [name for group in OBSERVATION_GROUPS for name in sorted(_names_of(group))]
    return f"it reads '{names[0]}', which we do not offer; {name_hint(names[0], known)}."
