"""The paper's prompt-editing experiments: what is edited, and what the paper found.

Source: Li et al., Exploring the Causality of End-to-End Autonomous Driving, 2024, section 4.2,
"Prompt Editing". The paper tells what was seen in examples; sizes and measures are ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from di_envs.config import check_name
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies import StudyError
from leaderboard.studies.rows import Row

LATERAL_M = 2.0  # over half a lane: into the neighbour's, or to the kerb
MOVED = ("routing", "target_point", "routing+target_point")


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """An experiment's outcome.

    Attributes:
        experiment: Its name.
        verdict: Of the paper's finding.
        sentence: With the numbers.
        numbers: What was measured, as JSON values: what the figure and the table are drawn from.
    """

    experiment: str
    verdict: ClaimVerdict
    sentence: str
    numbers: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A question, and the rows that answer it.

    Attributes:
        title: What is edited.
        claim: What the paper found.
        rows: Runs; none where recorded moments of the baseline are enough.
    """

    name: str
    title: str
    claim: str
    rows: tuple[Row, ...] = ()


def _rows(experiment: str, *edits: str) -> tuple[Row, ...]:
    return tuple(
        Row(name=f"{experiment}-{number}", edit=edit, group=experiment)
        for number, edit in enumerate(edits, start=1)
    )


EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {
        each.name: each
        for each in (
            Experiment(
                name="route",
                title="routing and target point moved sideways, alone and together",
                claim="moved alone neither steers the ego, moved together they do",
                rows=_rows(
                    "route",
                    *(
                        f"shift:{what},lateral={metres:g}"
                        for what in MOVED
                        for metres in (-LATERAL_M, LATERAL_M)
                    ),
                ),
            ),
            Experiment(
                name="speed",
                title="the given speed set from 0 to 15 m/s",
                claim="told 0 m/s it plans very close waypoints, told 10 m/s far ones",
            ),
            Experiment(
                name="map",
                title="noise on the map, and parts of it masked",
                claim="cases off road or blocked do not increase",
                rows=_rows(
                    "map",
                    "noise:map,sigma=0.5",
                    "noise:map,sigma=2",
                    "mask:map,p=0.3",
                    "mask:map,p=0.9",
                ),
            ),
            Experiment(
                name="lights",
                title="traffic lights recoloured",
                claim="the ego brakes for a green light that is shown as red, and is led by the"
                " colour that it is shown",
                rows=_rows("lights", "recolour:lights=red", "recolour:lights=green"),
            ),
            Experiment(
                name="bev",
                title="parts of the BEV features masked",
                claim="collisions, red lights, wrong lanes, drives off road and blocked ones"
                " increase",
                rows=_rows("bev", "mask:bev,p=0.3", "mask:bev,p=0.7"),
            ),
        )
    }
)


def choose_experiments(names: Sequence[str] = ()) -> tuple[Experiment, ...]:
    """Experiments by name; none for all.

    Raises:
        StudyError: If a name is unknown; suggests the nearest.
    """
    for name in names:
        try:
            check_name(name, EXPERIMENTS, "experiment")
        except ValueError as error:
            raise StudyError(str(error)) from error
    return tuple(each for each in EXPERIMENTS.values() if not names or each.name in names)
