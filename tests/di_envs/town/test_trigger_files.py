"""Trigger files: both layouts read, what is broken refused with the place, ours written back."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from di_envs.town.routing.trigger_files import (
    PlacedScenario,
    TriggerFileError,
    read_triggers,
    write_triggers,
)

HERE = {"x": 1.0, "y": -2.0, "z": 0.5, "yaw": 90.0, "pitch": 0.0}


def content(town: str = "Town05", number: int = 3, transform: Any = None) -> dict[str, Any]:
    """A trigger file with one scenario at one place."""
    event = {"transform": HERE if transform is None else transform}
    scenario = {
        "scenario_type": f"Scenario{number}",
        "available_event_configurations": [event],
    }
    return {"available_scenarios": [{town: [scenario]}]}


def written(path: Path, value: Any) -> Path:
    """The value as a JSON file."""
    path.write_text(json.dumps(value), encoding="utf-8")
    return path


def test_a_place_is_read_in_the_world_frame_with_its_yaw_in_radians(tmp_path: Path) -> None:
    path = written(tmp_path / "one.json", content())
    assert read_triggers(path, ["Town05"]) == (PlacedScenario(3, 1.0, -2.0, 0.5, math.pi / 2),)


def test_numbers_written_as_strings_are_read_as_the_leaderboard_does(tmp_path: Path) -> None:
    texts = {key: str(value) for key, value in HERE.items()}
    path = written(tmp_path / "one.json", content(transform=texts))
    assert read_triggers(path, ["Town05"])[0].x == 1.0


def test_a_file_for_all_towns_gives_those_of_one_whatever_the_case(tmp_path: Path) -> None:
    both = content("Town01", 1)["available_scenarios"] + content("Town05", 4)["available_scenarios"]
    path = written(tmp_path / "all.json", {"available_scenarios": both})
    assert [place.number for place in read_triggers(path, ["town05"])] == [4]


def test_a_folder_gives_its_files_in_the_order_of_their_names(tmp_path: Path) -> None:
    written(tmp_path / "b.json", content(number=1))
    written(tmp_path / "a.json", content(number=9))
    assert [place.number for place in read_triggers(tmp_path, ["Town05"])] == [9, 1]
    again = read_triggers([tmp_path / "b.json", tmp_path / "a.json"], ["Town05"])
    assert [place.number for place in again] == [1, 9]


def test_what_is_written_is_read_back_to_a_millimetre(tmp_path: Path) -> None:
    placed = [PlacedScenario(1, 1.0, 2.0, 3.0, -0.5), PlacedScenario(10, -7.5, 0.0, 0.0, 3.0)]
    write_triggers(tmp_path / "own.json", "here", placed)
    for given, read in zip(placed, read_triggers(tmp_path / "own.json", ["here"]), strict=True):
        assert read[:4] == given[:4]
        assert math.cos(read.yaw_rad - given.yaw_rad) == pytest.approx(1.0)


def test_a_town_without_scenarios_among_others_is_refused_and_the_others_listed(
    tmp_path: Path,
) -> None:
    path = written(tmp_path / "one.json", content("Town01"))
    with pytest.raises(TriggerFileError, match=r"placed in Town05; its towns: Town01\."):
        read_triggers(path, ["Town05"])


def test_a_file_without_any_scenario_places_none(tmp_path: Path) -> None:
    path = written(tmp_path / "none.json", {"available_scenarios": []})
    assert read_triggers(path, ["Town05"]) == ()


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ([], r"expected an object, got an empty list\. Expected is CARLA's trigger JSON"),
        ({"scenarios": []}, r"available_scenarios: is missing; there is 'scenarios'"),
        (
            {"available_scenarios": [{"Town05": {}}]},
            r"available_scenarios\[0\]\.Town05: expected a list",
        ),
        (content(number=11), r"unknown scenario type 'Scenario11'.*Scenario1 to Scenario10"),
        (content(transform=[1, 2]), r"configurations\[0\]\.transform: expected an object"),
        (content(transform={**HERE, "yaw": "north"}), r"finite number for 'yaw', got 'north'"),
        (content(transform={"x": 1, "y": 2, "yaw": 0}), r"transform\.z: is missing"),
        (content(transform={**HERE, "x": math.inf}), r"Infinity is no number of JSON"),
        (content(transform={**HERE, "x": "inf"}), r"finite number for 'x', got 'inf'"),
    ],
)
def test_a_broken_file_is_refused_with_the_place(tmp_path: Path, value: Any, says: str) -> None:
    path = written(tmp_path / "broken.json", value)
    with pytest.raises(TriggerFileError, match=f"broken.json.*{says}"):
        read_triggers(path, ["Town05"])


def test_a_missing_file_an_empty_folder_and_cut_json_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TriggerFileError, match="there is no such trigger file or folder"):
        read_triggers(tmp_path / "none.json", ["Town05"])
    with pytest.raises(TriggerFileError, match=r"holds no trigger file"):
        read_triggers(tmp_path, ["Town05"])
    cut = tmp_path / "cut.json"
    cut.write_text(json.dumps(content())[:40], encoding="utf-8")
    with pytest.raises(TriggerFileError, match=r"cut\.json.*is not whole JSON"):
        read_triggers(cut, ["Town05"])
