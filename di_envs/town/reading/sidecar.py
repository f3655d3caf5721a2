"""Signals for maps that carry none, or other ones than theirs: a sidecar file.

A sidecar is a JSON file:

    {"town": "Town05", "source": "where this is known from",
     "speed_limits": [{"map_kmh": 88.5, "kmh": 50}],
     "junctions": [
       {"junction": "53", "centre": [-127, -90], "kind": "lights"},
       {"junction": "224", "centre": [150, -1], "kind": "stop", "arms": "stem"},
       {"junction": "7", "kind": "stop", "arms": [{"at": [10, 4], "kind": "yield"}]}]}

`centre` (world x, y) finds the junction, whatever its id: ids differ between versions of CARLA's
maps. Without it the id does. `kind` is one of lights, stop, yield, none. `arms` is "all" (the
default), "stem" (the arm of a T that the through road passes) or a list: each entry's `at` is a
point near the arm's stop line, its `kind` (by default the junction's) what stands there; arms that
are not listed have nothing. Junctions that are not listed have nothing either.

`speed_limits` (optional) replaces limits that the map's editor left at its defaults: lanes whose
limit in the map is `map_kmh` (within 1 km/h) get `kmh`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from di_envs.files.json_text import read_json
from di_envs.files.json_values import from_json
from di_envs.town.lanes import Lanes, SignalKind
from di_envs.town.reading.arms import Arm, junction_arms, junction_centres, stem_of
from di_envs.town.reading.signals import Head, heads_of_arms

KINDS = {
    "lights": SignalKind.LIGHT,
    "stop": SignalKind.STOP,
    "yield": SignalKind.YIELD,
    "none": None,
}
SPEED_MATCH_KMH = 1.0
MATCH_M = 12.0  # between a junction's centre and the one that a sidecar names
ARM_MATCH_M = 12.0  # between an arm's stop line and the point that a sidecar names

Kind = Literal["lights", "stop", "yield", "none"]


@dataclass(frozen=True, kw_only=True)
class ArmRule:
    """What stands at the arm that ends nearest to `at`."""

    at: tuple[float, float]
    kind: str


@dataclass(frozen=True, kw_only=True)
class JunctionRule:
    """What stands at a junction."""

    name: str
    centre: tuple[float, float] | None
    kind: str
    arms: str | tuple[ArmRule, ...]


@dataclass(frozen=True, kw_only=True)
class Sidecar:
    """What a sidecar file says."""

    junctions: tuple[JunctionRule, ...]
    speed_limits: tuple[tuple[float, float], ...]  # limit in the map, limit instead [km/h]


# A file's objects, as it spells them


@dataclass(frozen=True, kw_only=True)
class _Arm:
    at: tuple[float, float]
    kind: Kind | None = None


@dataclass(frozen=True, kw_only=True)
class _Junction:
    junction: str | int | None = None
    centre: tuple[float, float] | None = None
    kind: Kind
    arms: Literal["all", "stem"] | tuple[_Arm, ...] = "all"

    def __post_init__(self) -> None:
        if self.junction is None and self.centre is None:
            raise ValueError("it has neither 'junction' nor 'centre'; one must say which it is")

    def rule(self) -> JunctionRule:
        """What it says."""
        arms: str | tuple[ArmRule, ...]
        if isinstance(self.arms, str):
            arms = self.arms
        else:
            arms = tuple(ArmRule(at=arm.at, kind=arm.kind or self.kind) for arm in self.arms)
        name = list(self.centre or ()) if self.junction is None else self.junction
        return JunctionRule(name=str(name), centre=self.centre, kind=self.kind, arms=arms)


@dataclass(frozen=True, kw_only=True)
class _Speed:
    map_kmh: float
    kmh: float

    def __post_init__(self) -> None:
        if not 0.0 < self.kmh <= 300.0:
            raise ValueError(f"kmh must lie in (0, 300], got {self.kmh:g}")


@dataclass(frozen=True, kw_only=True)
class _File:
    town: str = ""
    source: str = ""
    speed_limits: tuple[_Speed, ...] = ()
    junctions: tuple[_Junction, ...]


def read_sidecar(path: Path) -> Sidecar:
    """Reads a sidecar file.

    Raises:
        JsonError: If it is missing, is not JSON, or holds unknown keys, kinds or arms.
    """
    file = from_json(_File, read_json(path), str(path))
    return Sidecar(
        junctions=tuple(row.rule() for row in file.junctions),
        speed_limits=tuple((row.map_kmh, row.kmh) for row in file.speed_limits),
    )


def enforced_limits(lanes: Lanes, rules: tuple[tuple[float, float], ...]) -> Lanes:
    """The lanes with the limits that a sidecar puts in place of the map's."""
    kmh = lanes.speed_limit_mps * 3.6
    enforced = lanes.speed_limit_mps.copy()
    for in_map, instead in rules:
        enforced[np.abs(kmh - in_map) <= SPEED_MATCH_KMH] = instead / 3.6
    return lanes._replace(speed_limit_mps=enforced)


def heads_of_sidecar(
    rules: tuple[JunctionRule, ...], lanes: Lanes, junctions: tuple[str, ...], source: str
) -> list[Head]:
    """The heads that a sidecar's rules put into a town.

    Raises:
        ValueError: If a rule's junction or arm is not in the map.
    """
    centres = junction_centres(lanes, len(junctions))
    arms = junction_arms(lanes, len(junctions))
    chosen: dict[int, JunctionRule] = {}
    for rule in rules:
        junction = _match(rule, junctions, centres, source)
        if junction in chosen:
            raise ValueError(
                f"{source}: '{rule.name}' and '{chosen[junction].name}' are the same junction of "
                f"the map ('{junctions[junction]}'); keep one of them."
            )
        chosen[junction] = rule
    return [
        head
        for junction in sorted(chosen)
        for head in heads_of_arms(
            arms[junction], _arm_kinds(chosen[junction], arms[junction], source)
        )
    ]


def _match(
    rule: JunctionRule, junctions: tuple[str, ...], centres: NDArray[np.float64], source: str
) -> int:
    if rule.centre is None:
        if rule.name in junctions:
            return junctions.index(rule.name)
        raise ValueError(
            f"{source}: the map has no junction '{rule.name}'; it has {', '.join(junctions)}."
        )
    distance = np.hypot(*(centres - rule.centre).T)
    distance = np.where(np.isnan(distance), np.inf, distance)
    nearest = int(np.argmin(distance)) if len(distance) else -1
    if nearest < 0 or distance[nearest] > MATCH_M:
        found = f"the nearest is {distance[nearest]:.1f} m away" if nearest >= 0 else "it has none"
        raise ValueError(
            f"{source}: the map has no junction within {MATCH_M:g} m of '{rule.name}' at "
            f"{list(rule.centre)}: {found}. Is this sidecar for another map?"
        )
    return nearest


def _arm_kinds(rule: JunctionRule, arms: list[Arm], source: str) -> list[SignalKind | None]:
    if rule.arms == "all":
        return [KINDS[rule.kind]] * len(arms)
    if rule.arms == "stem":
        stem = stem_of(arms)
        if not stem:
            raise ValueError(
                f"{source}: junction '{rule.name}' has no stem: no two of its {len(arms)} arms "
                'look at each other. List its arms, or say "all".'
            )
        return [KINDS[rule.kind] if arm in stem else None for arm in arms]
    kinds: list[SignalKind | None] = [None] * len(arms)
    for entry in rule.arms:
        assert isinstance(entry, ArmRule)
        distance = [float(np.hypot(*(arm.end[:2] - entry.at))) for arm in arms]
        nearest = int(np.argmin(distance)) if distance else -1
        if nearest < 0 or distance[nearest] > ARM_MATCH_M:
            raise ValueError(
                f"{source}: junction '{rule.name}' has no arm that ends within {ARM_MATCH_M:g} m "
                f"of {list(entry.at)}."
            )
        kinds[nearest] = KINDS[entry.kind]
    return kinds
