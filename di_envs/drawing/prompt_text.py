"""The prompt in words, for people who watch: one line a component."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from di_envs.town.lanes import LightState
from di_envs.town.plan import RoadOption
from di_envs.world.kinds import ActorKind

COMMANDS = {
    0: "none",
    RoadOption.LEFT: "turn left",
    RoadOption.RIGHT: "turn right",
    RoadOption.STRAIGHT: "straight on",
    RoadOption.LANEFOLLOW: "follow the lane",
    RoadOption.CHANGELANELEFT: "change lane left",
    RoadOption.CHANGELANERIGHT: "change lane right",
}


def prompt_in_words(observation: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and content of each of the prompt's nine components.

    Args:
        observation: With the group `prompt`.
    """
    return [
        ("command", COMMANDS[int(observation["command"])]),
        ("target point", where(observation["target_point"])),
        ("routing", _routing(_rows(observation["routing"]))),
        ("map", f"{int((observation['map'][:, :, 3].max(axis=1) > 0).sum())} polylines"),
        ("obstacles", _obstacles(_rows(observation["obstacles"]))),
        ("traffic lights", _lights(_rows(observation["traffic_lights"]))),
        ("stop signs", _nearest(_rows(observation["stop_signs"]))),
        ("speed", f"{observation['speed'][0]:.1f} m/s ({3.6 * observation['speed'][0]:.0f} km/h)"),
        ("speed history", "  ".join(f"{speed:.1f}" for speed in observation["speed_history"])),
    ]


def where(place: Any) -> str:
    """A place in the ego frame: `32 m ahead, 4 m right`."""
    ahead, right = round(float(place[0])), round(float(place[1]))
    words = [f"{abs(ahead)} m {'ahead' if ahead >= 0 else 'behind'}"]
    if right:
        words.append(f"{abs(right)} m {'right' if right > 0 else 'left'}")
    return ", ".join(words)


def _rows(table: Any) -> Any:
    return table[table[:, -1] > 0.0]


def _routing(rows: Any) -> str:
    return f"{len(rows)} m to {where(rows[-1])}" if len(rows) else "none"


def _obstacles(rows: Any) -> str:
    if not len(rows):
        return "none"
    nearest = ActorKind(int(rows[0, 7])).name.lower()
    return f"{len(rows)}; {nearest} {where(rows[0])}"


def _lights(rows: Any) -> str:
    """How many stop lines of each colour there are, and where the nearest is."""
    if not len(rows):
        return "none"
    counts = [(state.name.lower(), int((rows[:, 3] == state).sum())) for state in LightState]
    colours = ", ".join(f"{count} {name}" for name, count in counts if count)
    return f"{colours}; {where(rows[0])}"


def _nearest(rows: Any) -> str:
    return f"{len(rows)}; {where(rows[0])}" if len(rows) else "none"
