"""What a language model answers: one JSON object, read strictly, as it is data and not a wish.

{"waypoints": [[2.0, 0.0], [4.1, 0.1], [6.3, 0.3], [8.6, 0.6]]}
{"manoeuvre": "follow", "speed_mps": 6.5}
{"manoeuvre": "stop"}
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

FORMS = (
    'Answer with one JSON object and nothing else: {"waypoints": [[ahead, right], ...]}, 2 to 8 '
    "places in metres 0.5 s apart, the first in 0.5 s; or "
    '{"manoeuvre": "follow", "speed_mps": number} along the route; or {"manoeuvre": "stop"}.'
)
LONGEST = 4000  # characters
FEWEST, MOST = 2, 8  # waypoints
FURTHEST_M, FASTEST_MPS = 100.0, 40.0
_SHOWN = 80  # characters of a wrong answer in an error


class AnswerError(ValueError):
    """An answer that is none of the forms; says what was expected and what came."""


@dataclass(frozen=True, kw_only=True)
class Waypoints:
    """Where the ego is to be: (T, 2) ahead, right [m], 0.5 s apart."""

    places: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Follow:
    """Along the route at a speed."""

    speed_mps: float


@dataclass(frozen=True)
class Stop:
    """To a stand, along the route."""


def read_answer(text: Any) -> Waypoints | Follow | Stop:
    """Reads an answer.

    Args:
        text: What the model returned.

    Raises:
        AnswerError: If it is anything but one of the forms.
    """
    if not isinstance(text, str):
        _refuse("text", repr(text))
    if len(text) > LONGEST:
        _refuse(f"at most {LONGEST} characters", f"{len(text)} of them")
    try:
        values = json.loads(text, parse_constant=_no_number, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        _refuse(f"one JSON object ({error})", repr(text))
    if not isinstance(values, dict):
        _refuse("a JSON object", repr(text))
    match values:
        case {"waypoints": places, **rest} if not rest:
            return Waypoints(places=_places(places))
        case {"manoeuvre": "stop", **rest} if not rest:
            return Stop()
        case {"manoeuvre": "follow", "speed_mps": speed, **rest} if not rest:
            return Follow(speed_mps=_number(speed, "speed_mps", 0.0, FASTEST_MPS))
    _refuse("waypoints alone, or a manoeuvre (follow with speed_mps, stop)", repr(text))


def _places(given: Any) -> NDArray[np.float32]:
    if not isinstance(given, list) or not FEWEST <= len(given) <= MOST:
        _refuse(f"{FEWEST} to {MOST} waypoints", repr(given))
    for place in given:
        if not isinstance(place, list) or len(place) != 2:
            _refuse("waypoints as [ahead, right]", repr(place))
    return np.array(
        [[_number(value, "a waypoint", -FURTHEST_M, FURTHEST_M) for value in p] for p in given],
        np.float32,
    )


def _number(value: Any, what: str, low: float, high: float) -> float:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    if not real or not math.isfinite(value) or not low <= value <= high:
        _refuse(f"{what} to be a number from {low:g} to {high:g}", repr(value))
    return float(value)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len({name for name, _ in pairs}) < len(pairs):
        raise ValueError("a name stands there twice")
    return dict(pairs)


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _refuse(expected: str, came: str) -> NoReturn:
    shown = came if len(came) <= _SHOWN else f"{came[:_SHOWN]}…"
    raise AnswerError(f"expected {expected}; got {shown}. {FORMS}")
