"""The whole prompt as text, for language models: every number, every object with its number.

`prompt_text` is for people who watch and shortens; here nothing is left out but the lane map, which
is lines of points. Objects have the numbers that they have in `told_picture`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from di_envs.drawing.prompt_text import COMMANDS
from di_envs.prompt import COMPONENTS
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind

FRAME = "Places are (ahead, right) of the car in metres: negative is behind, or to the left."
ROUTE_STEP_M = 5  # between the points of the route that are said; they come about 1 m apart
NOT_GIVEN = "not given"


def told_text(observation: Mapping[str, Any]) -> str:
    """The prompt in lines of ASCII text.

    Args:
        observation: With the group `prompt`, edited or not.
    """
    present = dict(zip(COMPONENTS, np.asarray(observation["prompt_present"]).tolist(), strict=True))
    lines = [FRAME]
    for name, say in _SAYS.items():
        title = name.replace("_", " ")
        if not present[name]:
            lines.append(f"{title}: {NOT_GIVEN}")
            continue
        first, *rest = say(observation[name])
        lines += [f"{title}: {first}", *rest]
    return "\n".join(lines)


def rows_of(table: Any) -> Any:
    """The valid rows of one of the prompt's tables: those that are said, in their order."""
    table = np.asarray(table)
    return table[table[:, -1] > 0.0]


def _speed(speed: Any) -> Iterator[str]:
    yield f"{float(speed[0]):.1f} m/s"


def _speeds(speeds: Any) -> Iterator[str]:
    yield f"{', '.join(f'{speed:.1f}' for speed in np.asarray(speeds).tolist())} m/s, latest first"


def _command(command: Any) -> Iterator[str]:
    yield COMMANDS[int(command)]


def _target(target: Any) -> Iterator[str]:
    yield f"{_place(target)}, heading {_degrees(target[2])}"


def _route(routing: Any) -> Iterator[str]:
    rows = rows_of(routing)
    said = [_place(row) for row in rows[ROUTE_STEP_M - 1 :: ROUTE_STEP_M]]
    yield f"a point each {ROUTE_STEP_M} m: {' '.join(said) if said else 'none, it ends here'}"


def _obstacles(obstacles: Any) -> Iterator[str]:
    rows = rows_of(obstacles)
    yield str(len(rows))
    for number, (x, y, yaw, length, width, vx, vy, kind, _) in enumerate(rows.tolist(), start=1):
        name = ActorKind(int(kind)).name.lower().replace("_", " ")
        yield (
            f"{number}. {name} at {_place((x, y))}, {length:.1f} m long, {width:.1f} m wide, "
            f"heading {_degrees(yaw)}, moves {_place((vx, vy))} a second"
        )


def _lights(lights: Any) -> Iterator[str]:
    rows = rows_of(lights)
    yield f"{len(rows)} stop lines"
    for number, (x, y, yaw, state, _) in enumerate(rows.tolist(), start=1):
        shows = LightState(int(state)).name.lower() if state else "none"
        yield f"L{number}. {shows} at {_place((x, y))}, heading {_degrees(yaw)}"


def _signs(signs: Any) -> Iterator[str]:
    rows = rows_of(signs)
    yield f"{len(rows)} stop lines"
    for number, (x, y, yaw, _) in enumerate(rows.tolist(), start=1):
        yield f"S{number}. at {_place((x, y))}, heading {_degrees(yaw)}"


def _place(place: Any) -> str:
    ahead, right = (round(float(part), 1) + 0.0 for part in place[:2])  # + 0.0: no -0.0
    return f"({ahead:.1f}, {right:.1f})"


def _degrees(yaw: Any) -> str:
    return f"{round(math.degrees(float(yaw)))} degrees"


_SAYS = {
    "speed": _speed,
    "speed_history": _speeds,
    "command": _command,
    "target_point": _target,
    "routing": _route,
    "obstacles": _obstacles,
    "traffic_lights": _lights,
    "stop_signs": _signs,
}
