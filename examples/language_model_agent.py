"""A language model's seat at the wheel, taken by a few rules: text in, a manoeuvre out.

Score it beside the others:

    driveinsight evaluate --agent llm:examples/language_model_agent.py:drive --suite town05_tiny

`drive` is told what a model would be told, and answers as a model is asked to: put your own call in
its place. Nothing is downloaded. Run as a script, `python examples/language_model_agent.py`, it
drives one route and prints what was said first.
"""

from __future__ import annotations

import itertools
import json
import math
import re

CRUISE_MPS = 8.0
BRAKING_MPS2 = 2.5
NOSE_M, GAP_M, HALF_LANE_M = 2.5, 3.0, 1.8
PLACE = r"\((-?[\d.]+), (-?[\d.]+)\)"


def drive(text: str) -> str:
    """The answer to a prompt: follows the route as fast as what is in its way allows."""
    route = [(0.0, 0.0), *places(line_of(text, "routing"))]
    free_m = min(
        [metres_to(route, place) - NOSE_M - GAP_M - half for place, half in obstacles(text)]
        + [metres_to(route, place) - NOSE_M for place in red_lines(text)],
        default=math.inf,
    )
    if free_m < 0.5:
        return json.dumps({"manoeuvre": "stop"})
    speed_mps = min(CRUISE_MPS, math.sqrt(2.0 * BRAKING_MPS2 * free_m))
    return json.dumps({"manoeuvre": "follow", "speed_mps": round(speed_mps, 2)})


def line_of(text: str, name: str) -> str:
    """The line that begins with a name."""
    return next((line for line in text.splitlines() if line.startswith(f"{name}:")), "")


def places(line: str) -> list[tuple[float, float]]:
    """All places in a line, (ahead, right)."""
    return [(float(ahead), float(right)) for ahead, right in re.findall(PLACE, line)]


def obstacles(text: str) -> list[tuple[tuple[float, float], float]]:
    """Where each object is, and half of its length."""
    found = re.findall(rf"^\d+\. .* at {PLACE}, ([\d.]+) m long", text, re.MULTILINE)
    return [((float(x), float(y)), float(length) / 2.0) for x, y, length in found]


def red_lines(text: str) -> list[tuple[float, float]]:
    """Stop lines of lights that are not green and face the car."""
    found = re.findall(
        rf"^L\d+\. (?:red|yellow) at {PLACE}, heading (-?\d+) degrees", text, re.MULTILINE
    )
    return [(float(x), float(y)) for x, y, heading in found if abs(int(heading)) < 45]


def metres_to(route: list[tuple[float, float]], place: tuple[float, float]) -> float:
    """Metres along the route to where it passes a place; infinite where it does not."""
    gone_m = 0.0
    for (x1, y1), (x2, y2) in itertools.pairwise(route):
        length = math.hypot(x2 - x1, y2 - y1)
        if length == 0.0:
            continue
        along = ((place[0] - x1) * (x2 - x1) + (place[1] - y1) * (y2 - y1)) / length
        aside = abs((place[1] - y1) * (x2 - x1) - (place[0] - x1) * (y2 - y1)) / length
        if 0.0 <= along <= length and aside < HALF_LANE_M:
            return gone_m + along
        gone_m += length
    return math.inf


def main() -> None:
    """Drives one route of the toy town."""
    from agents import load_agent
    from di_envs import RouteEnv
    from di_envs.drawing.told_text import told_text

    agent = load_agent(f"llm:{__file__}:drive")
    env = RouteEnv(suite="toy", observations=agent.requires.observations)
    observation, info = env.reset(seed=0, options={"route": 0})
    print(told_text(observation), "\n")
    memory = agent.start(env.plan, 0)
    over = False
    while not over:
        action, memory = agent.act(observation, memory)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    print(f"route {info['route_id']} ended by: {info['finished']}")
    print(f"driving score {info['driving_score']:.1f} after {info['game_time_s']:.1f} s")


if __name__ == "__main__":
    main()
