"""The rows of an ablation: what is taken away, and how, by name.

The components are those of the paper's Table 2. The poses that a memory is warped by carry the
speed, so they have a row of their own: they are no part of the prompt, so they cannot be dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from di_envs.config import check_name
from leaderboard.running.interventions import read_interventions
from leaderboard.studies import StudyError
from wrappers.interventions.edit import ObservationEdit

BASELINE, NULL = "baseline", "null"
WAYS = ("drop", "zero")
COMPONENTS = (
    "bev",
    "map",
    "routing",
    "command",
    "target_point",
    "speed",
    "speed_history",
    "obstacles",
    "stop_signs",
    "traffic_lights",
)
ODOMETRY = "odometry"


@dataclass(frozen=True, kw_only=True)
class Row:
    """What a study does to what the agent sees.

    Attributes:
        name: Also of its folder.
        edit: As text; empty for the baseline.
        component: What is taken away; empty where that is not the question.
        group: Rows of a group stand together in tables: how it is taken away, or the experiment.
    """

    name: str
    edit: str = ""
    component: str = ""
    group: str = ""

    @cached_property
    def edits(self) -> tuple[ObservationEdit, ...]:
        """As values, read once.

        Raises:
            EditError: If they cannot be read.
        """
        return read_interventions(self.edit)


BASELINE_ROW = Row(name=BASELINE)
NULL_ROW = Row(name=NULL, edit="identity:all")
ABLATION_ROWS = tuple(
    Row(name=f"{way}-{name}", edit=f"{way}:{name}", component=name, group=way)
    for way in WAYS
    for name in (*COMPONENTS, *(ODOMETRY,) * (way == "zero"))
)


def choose_rows(names: Sequence[str] = (), only: str | None = None) -> tuple[Row, ...]:
    """Rows of an ablation.

    Args:
        names: As `drop-routing`, `drop:routing`, or `routing` for both; none for all.
        only: `drop` or `zero`.

    Raises:
        StudyError: If a name is unknown; suggests the nearest. If nothing is left.
    """
    rows = [row for row in ABLATION_ROWS if only is None or row.group == only]
    if not names:
        return tuple(rows)
    wanted: set[str] = set()
    known = [*(row.name for row in ABLATION_ROWS), *COMPONENTS, ODOMETRY]
    for name in (name.replace(":", "-") for name in names):
        try:
            check_name(name, known, "row")
        except ValueError as error:
            raise StudyError(str(error)) from error
        wanted.add(name)
    chosen = tuple(row for row in rows if {row.name, row.component} & wanted)
    if not chosen:
        raise StudyError(f"--only {only} leaves none of the rows {', '.join(names)}")
    return chosen
