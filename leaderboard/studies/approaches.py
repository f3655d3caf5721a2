"""Lights that an ego meets, from replays: what they really showed, and what it did meanwhile.

A light is met once the ego comes within `APPROACH_M` of its stop line, moving, and until it is over
the line. Each colour that the light shows meanwhile is a case: the ego drives over, or it stands
before the line when the colour (or the drive) ends, or, still rolling, it has decided nothing.
Colours are those *in the world*, whatever the ego was told. Yellow counts as red: it too is hidden
where green is shown, and who is led by that drives over as soon as the light is yellow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from di_envs.route_env import RouteEnv
from di_envs.town.lanes import LightState
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.replay import replay
from leaderboard.running.perfect_driver import PerfectDriver, StopPoint, stop_points
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies.effects import Effect, share_effect
from leaderboard.studies.experiments import Judgement
from leaderboard.studies.numbers import effect_numbers, span_text
from leaderboard.studies.route_place import RoutePlace

APPROACH_M = 25.0
MOVING_MPS, STANDING_MPS = 1.0, 0.5
OVER_M = 2.0  # the nose is so far over the line: the ego does not stop for it any more
LED = 0.5  # the share of approaches from which on the ego is said to be led by what it is shown
RED_SHOWN, GREEN_SHOWN = "recolour:lights=red", "recolour:lights=green"


@dataclass(frozen=True, kw_only=True)
class Approach:
    """A light before the ego, while it showed one colour.

    Attributes:
        colour: `green` or `red`, which may have been yellow at first.
        crossed: Whether the ego went over the line meanwhile.
        held: Whether it stood before the line when that ended.
    """

    route_id: str
    seed: int
    route_hash: str
    colour: str
    crossed: bool
    held: bool


def approaches(run: RunRecord, record: RouteRecord, env: RouteEnv) -> list[Approach]:
    """The lights that were met in a recorded drive, colour by colour.

    Args:
        run: The run.
        record: One of its routes.
        env: From `replay_env(run)`.
    """
    watched: list[_Watched] = []
    place: RoutePlace | None = None
    for step in replay(run, record, env=env):
        state, ego = step.view.state, step.view.ego
        if place is None:
            place = RoutePlace(env.plan)
            stops = stop_points(step.view.town, env.plan, PerfectDriver())
            watched = [_Watched(stop=stop) for stop in stops if stop.light >= 0]
        place.move(float(state.x[ego]), float(state.y[ego]), float(state.yaw[ego]))
        for each in watched:
            each.look(place.route_m, float(state.speed[ego]), _asks(state.light[each.stop.light]))
    return [
        Approach(
            route_id=record.route_id,
            seed=record.seed,
            route_hash=record.route_hash,
            colour=colour.name.lower(),
            crossed=crossed,
            held=held,
        )
        for each in watched
        for colour, crossed, held in each.cases()
    ]


def _asks(light: int) -> LightState:
    """Green, or red for yellow as well."""
    return LightState.RED if light == LightState.YELLOW else LightState(int(light))


@dataclass
class _Watched:
    """A stop line that the ego may come to.

    Attributes:
        colour: What its light shows now that it is met; None before and after.
        done: Colours that have ended: crossed, held.
    """

    stop: StopPoint
    colour: LightState | None = None
    standing: bool = False
    over: bool = False
    done: list[tuple[LightState, bool, bool]] = field(default_factory=list)

    def look(self, route_m: float, speed_mps: float, colour: LightState) -> None:
        """A moment of the drive."""
        ahead_m = self.stop.route_m - route_m
        if self.over:
            return
        if self.colour is None:
            if 0.0 < ahead_m <= APPROACH_M and speed_mps > MOVING_MPS:
                self.colour = colour
            return
        if ahead_m < -OVER_M:
            self.done.append((self.colour, True, False))
            self.over, self.colour = True, None
            return
        if colour != self.colour:
            self.done.append((self.colour, False, self.standing))
            self.colour = colour
        self.standing = speed_mps < STANDING_MPS

    def cases(self) -> list[tuple[LightState, bool, bool]]:
        """All of them, the one that the drive ended in too."""
        last = [] if self.colour is None else [(self.colour, False, self.standing)]
        return [*self.done, *last]


def held_at_green(found: Sequence[Approach]) -> list[tuple[float, str]]:
    """1 or 0 for each green light that the ego decided about, and its route: did it stand?"""
    return [
        (float(a.held), a.route_hash)
        for a in found
        if a.colour == "green" and (a.crossed or a.held)
    ]


def ran_red(found: Sequence[Approach]) -> list[tuple[float, str]]:
    """1 or 0 for each red light that the ego decided about, and its route: did it drive over?"""
    return [
        (float(a.crossed), a.route_hash)
        for a in found
        if a.colour == "red" and (a.crossed or a.held)
    ]


def judge_lights(measured: Mapping[str, Sequence[Approach]]) -> Judgement | None:
    """Whether the ego is led by the colours that it is shown.

    Args:
        measured: Lights met, by the row's edit, the baseline's under an empty one.

    Returns:
        None unless both ways were driven and the ego met lights of the colour in question.
    """
    shares: dict[str, Effect] = {}
    unedited: dict[str, list[float]] = {}
    for edit, measure in ((RED_SHOWN, held_at_green), (GREEN_SHOWN, ran_red)):
        cases = measure(measured.get(edit, ()))
        if not cases:
            return None
        shares[edit] = share_effect(
            [share for share, _ in cases], [route for _, route in cases], tests=2, margin=LED
        )
        unedited[edit] = [share for share, _ in measure(measured.get("", ()))]
    red, green = shares[RED_SHOWN], shares[GREEN_SHOWN]
    sentence = (
        f"green lights shown as red: the ego stands before {_share(red)} "
        f"(unedited: {_plain(unedited[RED_SHOWN])}); red or yellow ones shown as green: it drives "
        f"over {_share(green)} (unedited: {_plain(unedited[GREEN_SHOWN])})"
    )
    return Judgement(
        experiment="lights",
        verdict=_verdict(red, green),
        sentence=sentence,
        numbers={
            "shares": {edit: effect_numbers(share) for edit, share in shares.items()},
            "unedited": {
                edit: {"mean": sum(each) / len(each) if each else None, "lights": len(each)}
                for edit, each in unedited.items()
            },
        },
    )


def _share(found: Effect) -> str:
    return f"{100 * found.mean:.0f} % of {found.pairs} ({span_text(found, 100.0, ' %')})"


def _plain(values: Sequence[float]) -> str:
    if not values:
        return "none met"
    return f"{100 * sum(values) / len(values):.0f} % of {len(values)}"


def _verdict(red: Effect, green: Effect) -> ClaimVerdict:
    both = (red, green)
    if all(each.low is not None and each.low > LED for each in both):
        return ClaimVerdict.HOLDS
    if any(each.high is not None and each.high < LED for each in both):
        return ClaimVerdict.DOES_NOT_HOLD
    return ClaimVerdict.UNDECIDED
