"""A recipe is read strictly, and its rounds are laid out one after the other."""

from __future__ import annotations

from pathlib import Path

import pytest

from agents.training.recipes.recipe import RecipeError, read_recipe
from agents.training.recipes.table import STAGE_KINDS
from tests.agents.training.recipes.toy_stages import TOY, Add, Count

RECIPES = Path(__file__).resolve().parents[4] / "recipes"


def test_rounds_come_one_after_the_other_each_with_what_was_made_before_it(toy):
    recipe = toy()
    assert (recipe.name, recipe.seed) == ("toy", 3)
    names = ["first", "sum-0", "more-1", "sum-1", "more-2", "sum-2"]
    assert [stage.name for stage in recipe.stages] == names
    assert recipe.stages[0].settings == Count(frames=2)
    last = recipe.stages[-1]
    assert last.settings == Add(data=("first", "more-*"), init_from="sum-1")
    assert last.takes == {"data": ("first", "more-1", "more-2"), "init_from": ("sum-1",)}
    assert last.inputs == ("first", "more-1", "more-2", "sum-1")
    assert last.named == ("first", "more-*", "sum-1")
    assert recipe.stages[1].takes == {"data": ("first",), "init_from": ()}


def test_stages_that_drive_share_no_number(toy):
    first = {stage.name: stage.first for stage in toy().stages if stage.kind == "count"}
    assert first == {"first": 0, "more-1": 10_000, "more-2": 20_000}


def test_a_stage_needs_all_that_it_is_made_of_and_no_more(toy):
    recipe = toy()
    needed = {
        name: [stage.name for stage in recipe.needed_for(name)] for name in ("more-1", "sum-1")
    }
    assert needed == {"more-1": ["more-1"], "sum-1": ["first", "sum-0", "more-1", "sum-1"]}
    assert recipe.needed_for(None) == recipe.stages
    with pytest.raises(RecipeError, match=r"toy\.toml: Unknown stage 'more'; did you mean 'more-"):
        recipe.needed_for("more")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("frames = 2", "frames = 'x'", "stage 'first': frames: expected a whole number, got 'x'"),
        ("frames = 2", "frame = 2", "stage 'first': unknown field 'frame'; did you mean 'frames'"),
        ("frames = 2", "", "stage 'first': frames: is missing"),
        ("frames = 2", "frames = nan", "stage 'first': frames: expected a whole number, got nan"),
        ('kind = "count"\nframes = 2', "frames = 2", "stage 'first': kind: is missing"),
        ('kind = "count"', 'kind = "coun"', "stage 'first': Unknown kind of stage 'coun'; did you"),
        ('name = "sum-0"', 'name = "first"', "stage 'first': there are two stages of that name"),
        ('name = "first"', 'name = "../a"', r"small letters, digits and '-', not '../a'"),
        ('"sum-{before}"', '"first"', "init_from: 'first' makes drives, and one that makes policy"),
        ('"sum-{before}"', '"sum-9"', "stage 'sum-1': init_from: 'sum-9' is no stage before it"),
        ('["first"]', '["more-1"]', "stage 'sum-0': data: 'more-1' is no stage before it"),
        ("rounds = 2", "rounds = 0", "stage 3: rounds must be 1 to 100, not 0"),
        ("rounds = 2", "rounds = 2\ntimes = 1", "stage 3: unknown field 'times'"),
        ("seed = 3", "seed = -3", "seed must not be negative, not -3"),
        ("seed = 3", "sed = 3", "unknown field 'sed'; did you mean 'seed'"),
        ("seed = 3", "seed == 3", "is not TOML: .* line 2"),
    ],
)
def test_what_is_wrong_is_said_with_file_stage_and_field(toy, old, new, message):
    with pytest.raises(RecipeError, match=rf"toy\.toml: .*{message}"):
        toy(TOY.replace(old, new, 1))


def test_no_stage_and_no_file_are_said(toy, tmp_path):
    with pytest.raises(RecipeError, match="stage: is missing"):
        toy("seed = 1")
    with pytest.raises(RecipeError, match="one stage at least"):
        toy("stage = []")
    with pytest.raises(RecipeError, match=r"missing\.toml: cannot be read \(No such file"):
        read_recipe(tmp_path / "missing.toml")


@pytest.mark.parametrize("path", sorted(RECIPES.glob("*.toml")), ids=lambda path: path.stem)
def test_a_shipped_recipe_begins_with_nothing_and_ends_with_a_policy(path):
    recipe = read_recipe(path)
    assert recipe.stages[0].kind == "collect"
    assert recipe.stages[-1].how.makes == "policy"
    assert {stage.kind for stage in recipe.stages} <= set(STAGE_KINDS)
