"""Where the record of a claim and that of its replay differ: a sentence each."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from leaderboard.records.record import EventRecord, RouteRecord
from leaderboard.scoring.names import EVENT_NAMES


def claim_differences(
    claim: RouteRecord, found: RouteRecord, unchecked: frozenset[str]
) -> Iterator[str]:
    """What the claim has otherwise than the replay, a sentence each."""
    for field in dataclasses.fields(RouteRecord):
        if field.name in unchecked:
            continue
        claimed, replayed = getattr(claim, field.name), getattr(found, field.name)
        if claimed == replayed:
            continue
        if field.name == "events":
            yield from _event_differences(claimed, replayed)
        elif dataclasses.is_dataclass(claimed) and dataclasses.is_dataclass(replayed):
            yield from _part_differences(field.name, claimed, replayed)
        elif field.name in ("controls", "observation_checks"):
            yield f"{field.name} are packed otherwise than these numbers are"
        elif field.name == "trace":
            yield _trace_difference(claimed, replayed)
        else:
            yield f"{field.name}: claimed {claimed}, the replay gives {replayed}"


def _part_differences(name: str, claimed: Any, replayed: Any) -> Iterator[str]:
    for part in dataclasses.fields(claimed):
        one, other = getattr(claimed, part.name), getattr(replayed, part.name)
        if one != other:
            yield f"{name}.{part.name}: claimed {one}, the replay gives {other}"


def _event_differences(
    claimed: tuple[EventRecord, ...], replayed: tuple[EventRecord, ...]
) -> Iterator[str]:
    if len(claimed) != len(replayed):
        yield f"{len(claimed)} events are claimed, the replay has {len(replayed)}"
    for number, (one, other) in enumerate(zip(claimed, replayed, strict=False)):
        if one != other:
            name = f"event {number} ({EVENT_NAMES[other.kind]} at {other.time_s:g} s)"
            yield from _part_differences(name, one, other)
            return  # what follows is often only shifted


def _trace_difference(claimed: tuple[Any, ...], replayed: tuple[Any, ...]) -> str:
    for one, other in zip(claimed, replayed, strict=False):
        if one != other:
            return f"trace at {other[0]:g} s: claimed {list(one)}, the replay gives {list(other)}"
    return f"trace: {len(claimed)} rows are claimed, the replay has {len(replayed)}"
