"""`driveinsight train --recipe` as a user calls it: stopped, gone on with, listed, refused."""

from __future__ import annotations

import pytest

from agents.training.data_card import drive_paths
from agents.training.frames import read_drive
from leaderboard.commands import recipe as module
from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_INTERRUPTED, EXIT_USAGE

SMALL = """
[[stage]]
name = "expert"
kind = "collect"
frames = 60
towns = ["small_grid"]

[[stage]]
name = "policy-0"
kind = "train"
data = ["expert"]
config = "tiny"
steps = 2
batch = 2

[[stage]]
rounds = 1

[[stage.each]]
name = "corrections-{round}"
kind = "correct"
learner = "policy-{before}"
frames = 20
towns = ["small_grid"]
hidden = { privileged = 1.0 }
"""


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


def train(recipe, *arguments):
    output = recipe.parent / "run"
    return main(["train", "--recipe", str(recipe), "--output", str(output), *arguments])


def test_a_recipe_is_stopped_gone_on_with_listed_and_done(recipe, capsys, monkeypatch):
    output, looks = recipe.parent / "run", list[float]()
    assert train(recipe, "--list") == 0
    assert capsys.readouterr().out.count("to do") == 3

    def clock_s():
        looks.append(25.0)  # each look takes so long: the third is over a minute after the first
        return sum(looks)

    monkeypatch.setattr(module, "monotonic", clock_s)
    assert train(recipe, "--workers", "1", "--minutes", "1") == EXIT_INTERRUPTED
    monkeypatch.undo()
    out = capsys.readouterr().out
    assert f"Next: driveinsight train --recipe {recipe} --output {output} goes on" in out
    assert train(recipe, "--workers", "1", "--stage", "policy-0") == 0
    out = capsys.readouterr().out
    assert "Stage 2 of 2, policy-0: waypoint loss" in out
    assert "All 2 stages are done" in out
    assert train(recipe, "--workers", "1") == 0
    out = capsys.readouterr().out
    assert "Stage 2" not in out
    assert "Stage 3 of 3, corrections-1: " in out
    policy = output / "policy-0" / "policy"
    assert f"Next: driveinsight evaluate --agent driveinsight:{policy} --suite" in out
    facts = read_drive(drive_paths(output / "corrections-1")[0]).facts
    assert facts["number"] == 10_000
    assert facts["hidden"] == ["map", "obstacles", "traffic_lights", "stop_signs"]
    assert train(recipe, "--list") == 0
    assert capsys.readouterr().out.count("done") == 3
    recipe.write_text(SMALL.replace("steps = 2", "steps = 3"))
    assert train(recipe) == EXIT_USAGE
    assert "steps was 2, is 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--recipe", "nowhere.toml"], "nowhere.toml: cannot be read (No such file"),
        (["--recipe", "RECIPE", "--stage", "polcy-0"], "did you mean 'policy-0'"),
        (["--recipe", "RECIPE", "--steps", "9"], "--steps is for a training without --recipe"),
        (["--recipe", "RECIPE", "--workers", "0"], "--workers must be at least 1"),
        (["--recipe", "RECIPE", "--minutes", "0"], "--minutes must be more than 0"),
        (["--stage", "policy-0"], "are of a recipe: add --recipe FILE"),
        (["--list"], "are of a recipe: add --recipe FILE"),
    ],
)
def test_a_wrong_request_says_what_to_do(recipe, arguments, told, capsys, monkeypatch):
    monkeypatch.chdir(recipe.parent)
    words = [str(recipe) if word == "RECIPE" else word for word in arguments]
    assert main(["train", *words]) == EXIT_USAGE
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--towns", "town5"], "did you mean 'town05'"),
        (["--hidden", "map=0.1"], "--hidden is of a learner"),
        (["--driver", "constant", "--hidden", "map"], "--hidden is PART=SHARE, such as map=0.1"),
        (["--driver", "constant", "--hidden", "mop=0.1"], "did you mean 'map'"),
    ],
)
def test_a_wrong_request_to_collect_says_what_to_do(arguments, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["collect", *arguments]) == EXIT_USAGE
    assert told in capsys.readouterr().err


def test_a_system_of_the_zoo_is_named_as_what_drives_it(recipe, capsys):
    two_stages = SMALL.partition("[[stage]]\nrounds")[0]
    recipe.write_text(two_stages.replace('config = "tiny"', 'config = "ego-only"'))
    assert train(recipe, "--workers", "1") == 0
    policy = recipe.parent / "run" / "policy-0" / "policy"
    assert f"Next: driveinsight evaluate --agent zoo:{policy} --suite" in capsys.readouterr().out
