"""Signals for maps that carry none: a sidecar file, or a guess from the shape of the junctions.

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

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
MANY_ARMS = 4  # junctions of so many arms get lights or all-way stops when guessing
LANES_FOR_LIGHTS = 1.75  # approach lanes an arm, on average, from which a guess takes lights

_FILE_KEYS = ("town", "source", "speed_limits", "junctions")
_SPEED_KEYS = ("map_kmh", "kmh")
_JUNCTION_KEYS = ("junction", "centre", "kind", "arms")
_ARM_KEYS = ("at", "kind")
_ARM_WORDS = ("all", "stem")


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


def read_sidecar(path: Path) -> Sidecar:
    """Reads a sidecar file.

    Raises:
        FileNotFoundError: If there is none.
        ValueError: If it is not JSON, or holds unknown keys, kinds or arms.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path} is not JSON ({error}); expected a signals sidecar.") from error
    _check_keys(content, _FILE_KEYS, str(path))
    if not isinstance(content.get("junctions"), list):
        raise ValueError(f"{path}: 'junctions' must be a list of objects.")
    rows = enumerate(content["junctions"])
    speeds = enumerate(content.get("speed_limits", ()))
    return Sidecar(
        junctions=tuple(_junction_rule(row, f"{path}: junctions[{i}]") for i, row in rows),
        speed_limits=tuple(_speed_rule(row, f"{path}: speed_limits[{i}]") for i, row in speeds),
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


def guessed_heads(lanes: Lanes, junctions: tuple[str, ...]) -> list[Head]:
    """Lights at large crossings, all-way stops at small ones, a stop at the stem of a T.

    Forks and merges, where no two arms look at each other, get nothing.
    """
    heads = []
    for arms in junction_arms(lanes, len(junctions)):
        stem = stem_of(arms)
        if not stem:
            continue
        kind = SignalKind.STOP
        if len(arms) >= MANY_ARMS:
            stem = arms
            if sum(len(arm.lanes) for arm in arms) >= LANES_FOR_LIGHTS * len(arms):
                kind = SignalKind.LIGHT
        heads += heads_of_arms(arms, [kind if arm in stem else None for arm in arms])
    return heads


def _junction_rule(row: Any, where: str) -> JunctionRule:
    _check_keys(row, _JUNCTION_KEYS, where)
    if "junction" not in row and "centre" not in row:
        raise ValueError(f"{where} has neither 'junction' nor 'centre'; one must say which it is.")
    kind = _checked(row.get("kind"), tuple(KINDS), f"{where}: kind")
    arms = row.get("arms", "all")
    if isinstance(arms, list):
        rules = []
        for i, arm in enumerate(arms):
            _check_keys(arm, _ARM_KEYS, f"{where}: arms[{i}]")
            own = _checked(arm.get("kind", kind), tuple(KINDS), f"{where}: arms[{i}]: kind")
            rules.append(ArmRule(at=_point(arm.get("at"), f"{where}: arms[{i}]: at"), kind=own))
        arms = tuple(rules)
    else:
        arms = _checked(arms, _ARM_WORDS, f"{where}: arms")
    return JunctionRule(
        name=str(row.get("junction", row.get("centre"))),
        centre=_point(row["centre"], f"{where}: centre") if "centre" in row else None,
        kind=kind,
        arms=arms,
    )


def _speed_rule(row: Any, where: str) -> tuple[float, float]:
    _check_keys(row, _SPEED_KEYS, where)
    try:
        in_map, instead = float(row["map_kmh"]), float(row["kmh"])
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{where} needs the numbers map_kmh and kmh, got {row!r}.") from None
    if not 0.0 < instead <= 300.0:
        raise ValueError(f"{where}: kmh must lie in (0, 300], got {instead:g}.")
    return in_map, instead


def _check_keys(row: Any, known: tuple[str, ...], where: str) -> None:
    if not isinstance(row, Mapping):
        raise ValueError(f"{where} must be an object with the keys {', '.join(known)}.")
    for key in row:
        _checked(key, known, f"{where}: key")


def _checked(value: Any, known: tuple[str, ...], where: str) -> str:
    if value in known:
        return str(value)
    near = difflib.get_close_matches(str(value), known, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}."
    raise ValueError(f"{where} '{value}' is unknown; {hint}")


def _point(value: Any, where: str) -> tuple[float, float]:
    try:
        x, y = value
        return float(x), float(y)
    except (TypeError, ValueError):
        raise ValueError(f"{where} must be [x, y] in metres, not {value!r}.") from None


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
