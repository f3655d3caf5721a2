"""A study as values: what was asked for, and of every drive what tables and figures need.

The runs in `rows/` are the evidence, with controls and hashes; this is what is read off them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from di_envs.world.event_names import EVENT_KEYS
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.studies.rows import BASELINE, NULL, Row


@dataclass(frozen=True, kw_only=True)
class StudyDrive:
    """A route driven once.

    Attributes:
        route_hash: Equal for equal routes, whatever their ids.
        episode: Hash of all its states: equal for equal drives.
        events: How often each kind happened, by the kind's name in lower case.
    """

    route_id: str
    seed: int
    route_hash: str
    driving_score: float
    route_completion: float
    infraction_score: float
    done_m: float
    game_s: float
    wall_s: float
    status: str
    episode: str
    events: Mapping[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, record: RouteRecord) -> StudyDrive:
        """What a study keeps of a route's record."""
        counts = Counter(EVENT_KEYS[event.kind] for event in record.events)
        return cls(
            route_id=record.route_id,
            seed=record.seed,
            route_hash=record.route_hash,
            driving_score=record.score.driving_score,
            route_completion=record.score.route_completion,
            infraction_score=record.score.infraction_score,
            done_m=record.done_m,
            game_s=record.game_s,
            wall_s=record.wall_s,
            status=record.status,
            episode=record.state_hash,
            events=dict(sorted(counts.items())),
        )


@dataclass(frozen=True, kw_only=True)
class DrivenRow:
    """A row and its drives so far, without those that the machinery lost.

    Attributes:
        planned: How many (route, seed) pairs there are to drive.
        left_out: Why it is not driven; empty if it is.
    """

    row: Row
    planned: int = 0
    drives: tuple[StudyDrive, ...] = ()
    left_out: str = ""

    @property
    def complete(self) -> bool:
        return len(self.drives) == self.planned > 0

    @property
    def wall_s(self) -> float:
        """Wall-clock time of its drives, added up over all processes."""
        return sum(drive.wall_s for drive in self.drives)

    def by_world(self) -> dict[tuple[str, int], StudyDrive]:
        """The drives by route and seed: by the world that they were in."""
        return {(drive.route_id, drive.seed): drive for drive in self.drives}


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study, finished or not.

    Attributes:
        kind: `ablation` or `prompt editing`.
        interventions: Edits that all rows share, the baseline too.
        requires: As a run's.
        isolated: As a run's.
        versions: Package versions; with `cpu` what bits depend on.
        rows: The baseline first, then the null row.
        extra: Further measures, by name, of studies that have any.
    """

    kind: str
    agent: str
    agent_version: str
    track: str
    requires: Mapping[str, Any]
    suite: str
    suite_version: int
    options: Mapping[str, Any]
    rules: str
    town: str
    town_hash: str
    routes_hash: str
    interventions: tuple[str, ...]
    versions: Mapping[str, str]
    cpu: str
    seeds: tuple[int, ...]
    isolated: bool = False
    rows: tuple[DrivenRow, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def row(self, name: str) -> DrivenRow:
        """The row of that name. KeyError if there is none."""
        for driven in self.rows:
            if driven.row.name == name:
                return driven
        raise KeyError(name)

    @property
    def baseline(self) -> DrivenRow:
        return self.row(BASELINE)

    @property
    def compared(self) -> tuple[DrivenRow, ...]:
        """The rows that say something: neither the baseline nor the null row, nor left out."""
        aside = (BASELINE, NULL)
        return tuple(d for d in self.rows if d.row.name not in aside and not d.left_out)

    @property
    def left_out(self) -> tuple[DrivenRow, ...]:
        return tuple(driven for driven in self.rows if driven.left_out)

    @property
    def complete(self) -> bool:
        return all(driven.complete or driven.left_out for driven in self.rows)


def study_of(kind: str, head: RunRecord, interventions: tuple[str, ...]) -> Study:
    """A study that begins: what all its runs have in common.

    Args:
        kind: Of study.
        head: Its baseline's run, without routes.
        interventions: Edits that all rows share.
    """
    return Study(
        kind=kind,
        agent=head.agent,
        agent_version=head.agent_version,
        track=head.track,
        requires=head.requires,
        suite=head.suite,
        suite_version=head.suite_version,
        options=head.options,
        rules=head.rules,
        town=head.town,
        town_hash=head.town_hash,
        routes_hash=head.routes_hash,
        interventions=interventions,
        versions=head.versions,
        cpu=head.cpu,
        seeds=head.seeds,
        isolated=head.isolated,
    )
