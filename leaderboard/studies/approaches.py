"""Approaches to traffic lights, from replays: what a light really showed, and what the ego did.

An approach begins when the ego comes within `APPROACH_M` of a stop line of its route, moving, and
ends when it is over the line or the drive ends. What the light shows *in the world* is noted, not
what the ego was told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from di_envs.route_env import RouteEnv
from di_envs.town.lanes import LightState
from leaderboard.bound import PerfectDriver, StopPoint, stop_points
from leaderboard.record import RouteRecord, RunRecord
from leaderboard.replay import replay
from leaderboard.studies.effects import Effect, effect
from leaderboard.studies.experiments import Judgement, Verdict
from leaderboard.studies.numbers import effect_numbers, span_text
from leaderboard.studies.route_place import RoutePlace

APPROACH_M = 25.0
MOVING_MPS, STANDING_MPS = 1.0, 0.5
OVER_M = 2.0  # the nose is so far over the line: the ego does not stop for it any more
LED = 0.5  # the share of approaches from which on the ego is said to be led by what it is shown
RED_SHOWN, GREEN_SHOWN = "recolour:lights=red", "recolour:lights=green"


@dataclass(frozen=True, kw_only=True)
class Approach:
    """An approach.

    Attributes:
        colour: What the light showed as it began, `green`, `yellow` or `red`.
        stood: Whether the ego came to a stand before the line while it still showed that.
        crossed: Whether it went over the line while it still showed that.
    """

    route_id: str
    seed: int
    route_hash: str
    colour: str
    stood: bool
    crossed: bool


def approaches(run: RunRecord, record: RouteRecord, env: RouteEnv) -> list[Approach]:
    """The approaches of a recorded drive.

    Args:
        run: The run.
        record: One of its routes.
        env: From `replay_env(run)`.
    """
    watched: list[_Watched] = []
    place: RoutePlace | None = None
    for step in replay(run, record, env=env):
        state = step.view.state
        if place is None:
            driver = PerfectDriver()
            place = RoutePlace(env.plan)
            stops = [s for s in stop_points(step.view.town, env.plan, driver) if s.light >= 0]
            watched = [_Watched(stop=stop) for stop in stops]
        ego = step.view.ego
        place.move(float(state.x[ego]), float(state.y[ego]), float(state.yaw[ego]))
        speed_mps = float(state.speed[ego])
        for each in watched:
            each.look(place.route_m, speed_mps, int(state.light[each.stop.light]))
    return [
        Approach(
            route_id=record.route_id,
            seed=record.seed,
            route_hash=record.route_hash,
            colour=LightState(each.colour).name.lower(),
            stood=each.stood,
            crossed=each.crossed,
        )
        for each in watched
        if each.colour is not None and each.colour != LightState.NONE
    ]


@dataclass
class _Watched:
    """A stop line that the ego may come to."""

    stop: StopPoint
    colour: int | None = None
    stood: bool = False
    crossed: bool = False
    over: bool = False

    def look(self, route_m: float, speed_mps: float, colour: int) -> None:
        """A moment of the drive."""
        ahead_m = self.stop.route_m - route_m
        if self.over:
            return
        if self.colour is None:
            if 0.0 < ahead_m <= APPROACH_M and speed_mps > MOVING_MPS:
                self.colour = colour
            return
        if colour != self.colour:
            self.over = True  # what it does now, it does for another colour
        elif ahead_m < -OVER_M:
            self.crossed = self.over = True
        elif speed_mps < STANDING_MPS:
            self.stood = True


def braked_for_green(found: Sequence[Approach]) -> list[tuple[float, str]]:
    """1 or 0 for each approach to a green light, and its route: whether the ego stood there."""
    return [(float(a.stood), a.route_hash) for a in found if a.colour == "green"]


def ran_red(found: Sequence[Approach]) -> list[tuple[float, str]]:
    """1 or 0 for each approach to a red light at which the ego stood or went over: did it go?"""
    return [
        (float(a.crossed and not a.stood), a.route_hash)
        for a in found
        if a.colour == "red" and (a.crossed or a.stood)
    ]


def judge_lights(measured: Mapping[str, Sequence[Approach]]) -> Judgement | None:
    """Whether the ego is led by the colours that it is shown.

    Args:
        measured: Approaches by the row's edit, the baseline's under an empty one.

    Returns:
        None unless both ways were driven and had approaches.
    """
    shares: dict[str, Effect] = {}
    unedited: dict[str, list[float]] = {}
    for edit, measure in ((RED_SHOWN, braked_for_green), (GREEN_SHOWN, ran_red)):
        pairs = measure(measured.get(edit, ()))
        if not pairs:
            return None
        shares[edit] = effect(
            [share for share, _ in pairs], [route for _, route in pairs], tests=2, margin=LED
        )
        unedited[edit] = [share for share, _ in measure(measured.get("", ()))]
    red, green = shares[RED_SHOWN], shares[GREEN_SHOWN]
    sentence = (
        f"shown red at a green light, the ego stands before the line in {_share(red)} "
        f"(unedited: {_plain(unedited[RED_SHOWN])}); shown green at a red light, it drives over "
        f"in {_share(green)} (unedited: {_plain(unedited[GREEN_SHOWN])})"
    )
    return Judgement(
        experiment="lights",
        verdict=_verdict(red, green),
        sentence=sentence,
        numbers={
            "shares": {edit: effect_numbers(share) for edit, share in shares.items()},
            "unedited": {
                edit: {"mean": sum(each) / len(each) if each else None, "approaches": len(each)}
                for edit, each in unedited.items()
            },
        },
    )


def _share(found: Effect) -> str:
    return f"{100 * found.mean:.0f} % of {found.pairs} approaches ({span_text(found, 100.0, ' %')})"


def _plain(values: Sequence[float]) -> str:
    if not values:
        return "no such approach"
    return f"{100 * sum(values) / len(values):.0f} % of {len(values)}"


def _verdict(red: Effect, green: Effect) -> Verdict:
    both = (red, green)
    if all(each.low is not None and each.low > LED for each in both):
        return Verdict.HOLDS
    if any(each.high is not None and each.high < LED for each in both):
        return Verdict.DOES_NOT_HOLD
    return Verdict.UNDECIDED
