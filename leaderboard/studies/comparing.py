"""Two runs paired by route and seed: what the second changed, how surely, where and by which event.

A pair is one world driven twice: equal route, seed, traffic, lights, versions and CPU. Runs that do
not share these are refused, as a difference between them would mean nothing. Files of the user's
own are told by what they hold, wherever they are and whatever they are called.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from di_envs.differences import differences
from di_envs.rules import rules_named
from di_envs.suite_files import FILE_OPTIONS
from di_envs.world.kinds import EventKind
from leaderboard.records.footing import footing_differences, footing_of, record_differences
from leaderboard.records.record import EventRecord, RouteRecord, RunRecord
from leaderboard.statistics.bootstrap import BootstrapInterval, clustered_interval

# Options of the environment that change what an agent sees or how often it decides, not the world
_SEEN_ONLY = frozenset(
    {"observations", "cameras", "lidar", "radars", "gnss_origin", "weather", "control_dt_s"}
)
_CHOICE = frozenset({"route_ids", "rules"})  # which routes, and what their events cost
SCORES = ("driving_score", "route_completion", "infraction_score")


class PairingError(Exception):
    """Two runs that cannot be paired; the message says why, and what to do."""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """One route and seed, driven in both runs, and the kinds of events that their rules list."""

    before: RouteRecord
    after: RouteRecord
    listed: tuple[EventKind, ...]

    @property
    def difference(self) -> float:
        """By how much the driving score rose."""
        return self.after.score.driving_score - self.before.score.driving_score

    @property
    def same_episode(self) -> bool:
        """Whether both went through the same states, bit for bit."""
        return self.before.state_hash == self.after.state_hash

    @property
    def changed(self) -> bool:
        """Whether the score or any event that counts differs."""
        return self.before.score != self.after.score or bool(self.gone or self.new)

    @property
    def gone(self) -> tuple[EventRecord, ...]:
        """Events of the first run that the second has fewer of, by kind; the last ones."""
        return _more(self.before.events, self.after.events, self.listed)

    @property
    def new(self) -> tuple[EventRecord, ...]:
        """Events of the second run that the first has fewer of, by kind; the last ones."""
        return _more(self.after.events, self.before.events, self.listed)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What two runs say of each other.

    Attributes:
        before: The first run.
        after: The second.
        pairs: Routes and seeds that both drove.
        lost: How many pairs the machinery lost in one run or both.
        unpaired: How many routes and seeds only one run has.
    """

    before: RunRecord
    after: RunRecord
    pairs: tuple[Pair, ...]
    lost: int
    unpaired: int

    @property
    def routes(self) -> int:
        """Number of distinct routes, by hash: what the interval's doubt rests on."""
        return len({pair.before.route_hash for pair in self.pairs})

    def interval(self, score: str) -> BootstrapInterval:
        """The mean difference, second less first, of one of `SCORES`."""
        return clustered_interval(
            [getattr(p.after.score, score) - getattr(p.before.score, score) for p in self.pairs],
            [pair.before.route_hash for pair in self.pairs],
        )

    def changes(self) -> list[Pair]:
        """The pairs that changed, the largest change of driving score first."""
        changed = [pair for pair in self.pairs if pair.changed]
        return sorted(changed, key=lambda pair: (-abs(pair.difference), pair.before.index))


def compare_runs(before: RunRecord, after: RunRecord) -> Comparison:
    """Pairs two runs.

    Raises:
        PairingError: If their worlds are not the same, or they share no route and seed.
    """
    if reasons := list(_obstacles(before, after)):
        raise PairingError(
            f"the runs cannot be paired: {'; '.join(reasons)}. Evaluate both anew with the same "
            "program on the same machine and suite"
        )
    if before.rules != after.rules:
        raise PairingError(
            f"one run is scored by {before.rules}, the other by {after.rules}: "
            "pass --rules to score both by the same"
        )
    ours = {(record.route_id, record.seed): record for record in before.routes}
    theirs = {(record.route_id, record.seed): record for record in after.routes}
    shared = [key for key in ours if key in theirs]
    listed = rules_named(before.rules).infractions
    pairs = [Pair(before=ours[key], after=theirs[key], listed=listed) for key in shared]
    driven = tuple(pair for pair in pairs if not (pair.before.lost or pair.after.lost))
    for pair in driven:
        if pair.before.route_hash != pair.after.route_hash:
            raise PairingError(
                f"route {pair.before.route_id} is not the same route in both runs: their route "
                "or scenario files differ"
            )
    if not driven:
        raise PairingError("the runs share no route and seed that both drove")
    return Comparison(
        before=before,
        after=after,
        pairs=driven,
        lost=len(pairs) - len(driven),
        unpaired=len(ours) + len(theirs) - 2 * len(shared),
    )


def _obstacles(before: RunRecord, after: RunRecord) -> Iterator[str]:
    """Why the worlds of two runs are not the same, a few words each."""
    yield from footing_differences(footing_of(before), footing_of(after))
    by_content = bool(before.world and after.world)
    own_files = by_content and before.suite_version == after.suite_version == 0
    names = () if own_files else ("suite",)  # own routes are called as their file is
    fields = (*names, "suite_version", *(() if by_content else ("town",)), "town_hash")
    found = record_differences(before, after, fields)
    ours, theirs = (_world_values(run, names, by_content) for run in (before, after))
    yield from (difference.is_not for difference in (*found, *differences(ours, theirs)))


def _world_values(run: RunRecord, names: tuple[str, ...], by_content: bool) -> dict[str, object]:
    """What makes up a run's world beside its routes, which are compared pair by pair."""
    given = {**run.requires.get("options", {}), **run.options}
    aside = _SEEN_ONLY | _CHOICE | (frozenset(FILE_OPTIONS) if by_content else frozenset())
    options = {name: value for name, value in given.items() if name not in aside}
    held = [*names, "town", "signals"] if by_content else []
    return {"option": options, "content of": {name: run.world.get(name) for name in held}}


def _more(
    events: tuple[EventRecord, ...],
    others: tuple[EventRecord, ...],
    kinds: tuple[EventKind, ...],
) -> tuple[EventRecord, ...]:
    """Those events of some kinds that are beyond their number among the others, in time's order."""
    left = Counter(event.kind for event in others)
    beyond = []
    for event in events:
        if left[event.kind] > 0:
            left[event.kind] -= 1
        elif event.kind in kinds:
            beyond.append(event)
    return tuple(beyond)
