"""A recipe is gone on with wherever it was cut off, and in nothing that was made otherwise."""

from __future__ import annotations

import dataclasses
import json
import shutil
from contextlib import contextmanager

import pytest

from agents.training.recipes import marker as markers
from agents.training.recipes.marker import read_marker
from agents.training.recipes.recipe import RecipeError
from agents.training.recipes.running import run_recipe, standings
from tests.agents.training.recipes.toy_stages import TOY, Watch

ALL = ["first", "sum-0", "more-1", "sum-1", "more-2", "sum-2"]


def files_of(folder):
    """All that was made, without how long it took."""
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "stage.json"
    }


def test_all_stages_are_done_in_order_and_their_sums_come_out(toy, tmp_path):
    watch = Watch()
    assert run_recipe(toy(), tmp_path / "run", watch)
    assert watch.begun == watch.ended == ALL
    sums = [(tmp_path / "run" / f"sum-{n}" / "policy" / "sum").read_text() for n in range(3)]
    # seed 3 + drives 0, 1; then 10000 more and the last sum; then 20000 more and the last sum
    assert sums == ["4", f"{3 + 1 + 10000 + 4:g}", f"{3 + 1 + 30000 + 10008:g}"]


def test_stopped_at_any_moment_it_comes_to_the_same(toy, tmp_path):
    recipe, whole = toy(), Watch()
    run_recipe(recipe, tmp_path / "whole", whole)
    for stop_at in range(1, whole.asked + 1):
        folder = tmp_path / str(stop_at)
        assert not run_recipe(recipe, folder, Watch(stop_at=stop_at))
        assert run_recipe(recipe, folder, Watch())
        assert files_of(folder) == files_of(tmp_path / "whole")


def test_what_is_done_is_not_done_again(toy, tmp_path):
    run_recipe(toy(), tmp_path / "run", Watch(), goal="sum-1")
    watch = Watch()
    assert run_recipe(toy(), tmp_path / "run", watch)
    assert watch.begun == ["more-2", "sum-2"]
    again = Watch()
    assert run_recipe(toy(), tmp_path / "run", again)
    assert again.begun == []


def test_how_all_stages_stand_is_known_without_doing_any(toy, tmp_path):
    recipe = toy()
    assert [each.state for each in standings(recipe, tmp_path / "run")] == ["to do"] * 6
    run_recipe(recipe, tmp_path / "run", Watch(stop_at=7))  # in the middle of a stage
    found = standings(recipe, tmp_path / "run")
    assert [each.state for each in found] == ["done", "done", "under way", *["to do"] * 3]
    assert found[0].marker.samples == 2
    assert found[0].marker.spent_s >= 0.0


def test_how_long_a_stage_took_is_added_up_over_all_runs(toy, tmp_path):
    recipe, folder = toy(), tmp_path / "run"
    run_recipe(recipe, folder, Watch(stop_at=3))
    path = folder / "first" / "stage.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "spent_s": 100.0}))
    run_recipe(recipe, folder, Watch())
    assert 100.0 <= read_marker(folder / "first").spent_s < 160.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("frames = 2", "frames = 3", "stage 'first' in .* made otherwise .frames was 2, is 3"),
        ("frames = 2", "frames = 2\nby = 2.0", r"stage 'first' .*by was 1\.0, is 2\.0"),
        ("seed = 3", "seed = 4", "stage 'first' .*seed was 3, is 4"),
        ("init_from", "steps = 2\ninit_from", "stage 'sum-1' .*steps was 1, is 2"),
        (
            'data = ["first"]',
            'data = ["first"]\nsteps = 2',
            "stage 'sum-0' .*steps was 1, is 2",
        ),
    ],
)
def test_another_setting_is_refused_by_name_before_anything_is_done(
    toy, tmp_path, old, new, message
):
    run_recipe(toy(), tmp_path / "run", Watch())
    before, watch = files_of(tmp_path / "run"), Watch()
    with pytest.raises(RecipeError, match=message):
        run_recipe(toy(TOY.replace(old, new, 1)), tmp_path / "run", watch)
    assert watch.begun == []
    assert files_of(tmp_path / "run") == before


def test_what_a_stage_under_way_was_begun_with_cannot_change_either(toy, tmp_path):
    run_recipe(toy(), tmp_path / "run", Watch(stop_at=2))
    with pytest.raises(RecipeError, match=r"frames was 2, is 3.*put that back, or delete"):
        run_recipe(toy(TOY.replace("frames = 2", "frames = 3")), tmp_path / "run", Watch())


def test_in_another_world_nothing_goes_on(toy, tmp_path, monkeypatch):
    run_recipe(toy(), tmp_path / "run", Watch(), goal="first")
    monkeypatch.setattr(markers, "WORLD_VERSION", 999)
    with pytest.raises(RecipeError, match=r"world_version was \d+, is 999"):
        run_recipe(toy(), tmp_path / "run", Watch())


def test_a_stage_that_another_has_done_meanwhile_is_not_done_again(toy, tmp_path):
    """Two commands go on with one recipe: the second waits at a folder until the first has left."""
    folder, others = tmp_path / "run", Watch()

    @contextmanager
    def alone(stage):
        if stage.name == "sum-0" and not others.begun:
            assert run_recipe(toy(), folder, others, goal="sum-0")
        yield

    watch = Watch()
    assert run_recipe(toy(), folder, watch, alone=alone)
    assert others.begun == ["sum-0"]
    assert watch.begun == [name for name in ALL if name != "sum-0"]


def test_a_setting_newer_than_the_folder_is_taken_for_its_default(toy, tmp_path):
    run_recipe(toy(), tmp_path / "run", Watch())
    path = tmp_path / "run" / "first" / "stage.json"
    content = json.loads(path.read_text())
    del content["settings"]["by"]
    path.write_text(json.dumps(content))
    assert run_recipe(toy(), tmp_path / "run", Watch())
    with pytest.raises(RecipeError, match=r"by was 1\.0, is 2\.0"):
        run_recipe(
            toy(TOY.replace("frames = 2", "frames = 2\nby = 2.0")), tmp_path / "run", Watch()
        )


def test_inputs_that_have_changed_since_are_refused(toy, tmp_path):
    run_recipe(toy(), tmp_path / "run", Watch(), goal="sum-0")
    (tmp_path / "run" / "first" / "toy" / "00001.npz").write_text("7")
    assert run_recipe(toy(), tmp_path / "run", Watch(), goal="more-1")  # does not take them
    with pytest.raises(RecipeError, match="are not those that stage 'first' had made"):
        run_recipe(toy(), tmp_path / "run", Watch())


def test_a_stage_deleted_is_done_again_once_what_came_of_it_is_deleted_too(toy, tmp_path):
    folder = tmp_path / "run"
    run_recipe(toy(), folder, Watch(), goal="sum-1")
    shutil.rmtree(folder / "more-1")
    with pytest.raises(RecipeError, match=r"'sum-1' in .* was made of 'more-1', which is not"):
        run_recipe(toy(), folder, Watch())
    shutil.rmtree(folder / "sum-1")
    watch = Watch()
    assert run_recipe(toy(), folder, watch)
    assert watch.begun == ["more-1", "sum-1", "more-2", "sum-2"]


@pytest.mark.parametrize("text", ["", "{}", '{"format": "x"}'], ids=len)
def test_a_garbled_marker_says_what_to_do(toy, tmp_path, text):
    run_recipe(toy(), tmp_path / "run", Watch(), goal="first")
    (tmp_path / "run" / "first" / "stage.json").write_text(text)
    with pytest.raises(RecipeError, match=r"stage\.json: .* delete .*first to do that stage"):
        run_recipe(toy(), tmp_path / "run", Watch())


def test_a_stage_that_fails_is_gone_on_with(toy, tmp_path):
    """As after a kill: what was written stays, and the stage is under way."""
    recipe, folder = toy(), tmp_path / "run"

    class Killed(Watch):
        def tells(self, progress):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_recipe(recipe, folder, Killed())
    assert standings(recipe, folder)[0].state == "under way"
    assert run_recipe(recipe, folder, Watch())
    run_recipe(recipe, tmp_path / "whole", Watch())
    assert files_of(folder) == files_of(tmp_path / "whole")
    assert dataclasses.replace(read_marker(folder / "first"), spent_s=0.0) == dataclasses.replace(
        read_marker(tmp_path / "whole" / "first"), spent_s=0.0
    )
