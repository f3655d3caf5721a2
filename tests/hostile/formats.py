"""Every format that is read: how a whole file of it is made, what reads it, what may refuse it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from agents.driveinsight.config import PlannerConfig, PolicyConfig
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import WeightsError, from_pretrained, save_pretrained
from agents.training.config import TrainConfig, TrainingError
from agents.training.frames import (
    ACTOR_FIELDS,
    DriveFileError,
    RecordedDrive,
    _whole_fields,
    read_drive,
    read_dropped,
    write_drive,
    write_dropped,
)
from agents.training.learning import Training
from agents.training.log import append_row, forget_rows_after, read_rows
from agents.training.recipes.marker import Marker, read_marker, write_marker
from agents.training.recipes.recipe import RecipeError, read_recipe
from agents.zoo.registry import config_of, network_of
from agents.zoo.weights import load_system, save_system
from di_envs.edits.text import EditError
from di_envs.edits.world import read_world_edits
from di_envs.files.json_text import JsonError
from di_envs.town import cache
from di_envs.town.loading import load_town
from di_envs.town.reading.sidecar import read_sidecar
from di_envs.town.routing.routes import (
    Keypoint,
    RouteFileError,
    RouteScenario,
    RouteSpec,
    read_routes,
    write_routes,
)
from di_envs.town.routing.scenarios import PlacedScenario
from di_envs.town.routing.trigger_files import TriggerFileError, read_triggers, write_triggers
from di_envs.world.state import Capacity, EventKind, state_dtype
from leaderboard.records.results import ResultsError, read_run, write_run
from leaderboard.responding.response_files import (
    ResponseFileError,
    read_responses,
    write_responses,
)
from leaderboard.running.interventions import read_interventions
from leaderboard.studies import StudyError
from leaderboard.studies.study_file import read_study, write_study
from tests.di_envs.town.small_maps import one_street
from tests.leaderboard.made_records import event, route, run_of
from tests.leaderboard.responding.made_drives import made_drive
from tests.leaderboard.studies.drives_here import drive, row, study

TINY = PolicyConfig(
    name="one",
    camera=None,
    lidar=None,
    memory_frames=0,
    planner=PlannerConfig(width=8, heads=2, layers=1, waypoints=2),
)
_ROWS = tuple(row(name, drive("0"), drive("1")) for name in ("baseline", "null"))
_TRIGGER = PlacedScenario(3, 1.0, 2.0, 0.0, 0.5)


RECIPE = """seed = 3

[[stage]]
name = "expert"
kind = "collect"
frames = 10

[[stage]]
rounds = 2

[[stage.each]]
name = "policy-{round}"
kind = "plan"
data = ["expert"]
config = "tiny"
"""


@dataclass(frozen=True, kw_only=True)
class Format:
    """One kind of file.

    Attributes:
        file: Where in a folder it lies.
        make: Makes a whole one there, and what else it needs.
        read: Reads what is in the folder.
        refusals: What reading may raise; nothing else.
        text: Whether it is text, to be damaged as such; JSON if its name says so.
    """

    file: str
    make: Callable[[Path], Any]
    read: Callable[[Path], Any]
    refusals: tuple[type[Exception], ...]
    text: bool = True


def _make_run(folder: Path) -> None:
    events = (event(EventKind.RED_LIGHT),)
    write_run(folder, run_of(route(events=events), route(route_id="8", index=1)))


def _make_stage(folder: Path) -> None:
    (folder / "recipe.toml").write_text(RECIPE)
    stages = read_recipe(folder / "recipe.toml").stages
    write_marker(folder, Marker.of(stages[1], 3, {"expert": "ab"}))


def _make_drive(folder: Path) -> None:
    capacity = Capacity(egos=1, vehicles=2, walkers=1, props=0, junctions=1, signals=1)
    layout, moments, actors = state_dtype(capacity), 3, 6
    facts = {"town": "toy", "town_hash": "ab", "number": 0, "route_id": "0", "scenarios": {}}
    whole = {
        name: np.zeros((moments, *layout[name].shape), layout[name].base)
        for name in _whole_fields(capacity)
    }
    kept = RecordedDrive(
        facts=facts,
        capacity=capacity,
        whole=whole,
        actors={name: np.zeros(actors, layout[name].base) for name in ACTOR_FIELDS},
        actor_id=np.array([0, 1, 0, 1, 0, 1], np.int16),
        first=np.array([0, 2, 4, 6]),
        controls=np.zeros((moments, 3), np.float32),
    )
    write_drive(folder / "0.npz", kept)


def _make_town(folder: Path) -> None:
    load_town("toy", cache_folder=folder)
    (path,) = folder.glob("*.npz")
    path.rename(folder / "town.npz")


def _read_town(folder: Path) -> Any:
    town = load_town("toy", cache_folder=folder / "none")
    key = cache.cache_key(town.content_hash)
    (folder / "town.npz").rename(folder / f"{key}.npz")
    try:
        found = cache.load_cached(town.content_hash, town.name, town.opendrive, folder)
    finally:
        (folder / f"{key}.npz").rename(folder / "town.npz")
    assert found is None or found.lanes.points.tobytes() == town.lanes.points.tobytes()
    return found


def _training() -> Training:
    return Training.begin(TINY, TrainConfig(), torch.device("cpu"))


def _make_log(folder: Path) -> None:
    for step in (10, 20, 30):
        append_row(folder / "log.csv", {"step": step, "total": 0.5, "waypoints": 1.25})


def _read_log(folder: Path) -> None:
    read_rows(folder / "log.csv")
    forget_rows_after(folder / "log.csv", 20)


def _make_routes(folder: Path) -> None:
    points = (Keypoint(0.0, 0.0, 0.0), Keypoint(50.0, 0.0, 0.0))
    scenario = RouteScenario("one", "DynamicObjectCrossing", 10.0, 0.0, 0.0, 0.0)
    spec = RouteSpec(route_id="0", town="toy", keypoints=points, scenarios=(scenario,))
    write_routes(folder / "routes.xml", [spec])


def _make_sidecar(folder: Path) -> None:
    arms = [{"at": [1.0, 2.0], "kind": "stop"}]
    junctions = [{"junction": "1", "kind": "lights", "arms": arms}]
    limits = [{"map_kmh": 50.0, "kmh": 30.0}]
    content = {"town": "toy", "junctions": junctions, "speed_limits": limits}
    (folder / "signals.json").write_text(json.dumps(content))


FORMATS = {
    "run": Format(
        file="driveinsight.json", make=_make_run, read=read_run, refusals=(ResultsError,)
    ),
    "route of a run": Format(
        file="routes/0000.json", make=_make_run, read=read_run, refusals=(ResultsError,)
    ),
    "study": Format(
        file="study.json",
        make=lambda folder: write_study(folder, study(*_ROWS)),
        read=read_study,
        refusals=(StudyError,),
    ),
    "route file": Format(
        file="routes.xml",
        make=_make_routes,
        read=lambda folder: read_routes(folder / "routes.xml"),
        refusals=(RouteFileError,),
    ),
    "map": Format(
        file="map.xodr",
        make=lambda folder: (folder / "map.xodr").write_text(one_street()),
        read=lambda folder: load_town(folder / "map.xodr", "none", cache_folder=folder / "cache"),
        refusals=(ValueError, FileNotFoundError),
    ),
    "sidecar": Format(
        file="signals.json",
        make=_make_sidecar,
        read=lambda folder: read_sidecar(folder / "signals.json"),
        refusals=(JsonError,),
    ),
    "triggers": Format(
        file="triggers.json",
        make=lambda folder: write_triggers(folder / "triggers.json", "toy", [_TRIGGER]),
        read=lambda folder: read_triggers(folder / "triggers.json", ["toy"]),
        refusals=(TriggerFileError,),
    ),
    "policy": Format(
        file="config.json",
        make=lambda folder: save_pretrained(Policy(TINY), folder, "a card"),
        read=from_pretrained,
        refusals=(WeightsError,),
    ),
    "weights": Format(
        file="weights.safetensors",
        make=lambda folder: save_pretrained(Policy(TINY), folder, "a card"),
        read=from_pretrained,
        refusals=(WeightsError,),
        text=False,
    ),
    "system of the zoo": Format(
        file="config.json",
        make=lambda folder: save_system(network_of(config_of("ego-only")), folder, "a card"),
        read=load_system,
        refusals=(WeightsError,),
    ),
    "recipe": Format(
        file="recipe.toml",
        make=lambda folder: (folder / "recipe.toml").write_text(RECIPE),
        read=lambda folder: read_recipe(folder / "recipe.toml"),
        refusals=(RecipeError,),
    ),
    "stage of a recipe": Format(
        file="stage.json",
        make=_make_stage,
        read=read_marker,
        refusals=(RecipeError,),
    ),
    "checkpoint": Format(
        file="checkpoint.pt",
        make=lambda folder: _training().save(folder / "checkpoint.pt"),
        read=lambda folder: _training().load(folder / "checkpoint.pt"),
        refusals=(TrainingError,),
        text=False,
    ),
    "log of a training": Format(
        file="log.csv", make=_make_log, read=_read_log, refusals=(TrainingError,)
    ),
    "drive": Format(
        file="0.npz",
        make=_make_drive,
        read=lambda folder: read_drive(folder / "0.npz"),
        refusals=(DriveFileError,),
        text=False,
    ),
    "dropped drive": Format(
        file="0.dropped.json",
        make=lambda folder: write_dropped(folder / "0.dropped.json", "red light", {"driver": "x"}),
        read=lambda folder: read_dropped(folder / "0.dropped.json"),
        refusals=(DriveFileError,),
    ),
    "responses": Format(
        file="route-0-seed-0.npz",
        make=lambda folder: write_responses(
            folder / "route-0-seed-0.npz", made_drive([[1.0, 0.0]] * 3, events=((0.5, "red"),))
        ),
        read=lambda folder: read_responses(folder / "route-0-seed-0.npz"),
        refusals=(ResponseFileError,),
        text=False,
    ),
    "town cache": Format(
        file="town.npz", make=_make_town, read=_read_town, refusals=(), text=False
    ),
    "interventions": Format(
        file="edits.txt",
        make=lambda folder: (folder / "edits.txt").write_text("drop:routing; set:speed=0@t>5"),
        read=lambda folder: read_interventions((folder / "edits.txt").read_text(errors="replace")),
        refusals=(EditError,),
    ),
    "world edits": Format(
        file="edits.txt",
        make=lambda folder: (folder / "edits.txt").write_text(
            "remove:actor=7; move:actor=7,ahead=5"
        ),
        read=lambda folder: read_world_edits((folder / "edits.txt").read_text(errors="replace")),
        refusals=(EditError,),
    ),
}


class Ran:
    """Unpickled, it leaves a file behind: code has run."""

    def __init__(self, canary: Path) -> None:
        self.canary = canary

    def __reduce__(self) -> Any:
        return Path.touch, (self.canary,)


def packed_code(form: str, path: Path, canary: Path) -> None:
    """Writes a file of arrays, or of tensors, that holds a pickle which runs code."""
    if form == "checkpoint":
        torch.save({"policy_config": Ran(canary)}, path)
        return
    with np.load(path, allow_pickle=False) as stored:
        arrays = dict(stored)
    first = next(iter(arrays))
    arrays[first] = np.array([Ran(canary)], object)
    np.savez(path, **arrays)
