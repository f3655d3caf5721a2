"""A stage that takes a policy of the package: others go on from it, as from one made there."""

from __future__ import annotations

import pytest

from agents.driveinsight.agent import SHIPPED
from agents.networks.weights import WEIGHTS_FILE
from agents.training.recipes.recipe import RecipeError, read_recipe
from agents.training.recipes.running import run_recipe, standings
from tests.agents.training.recipes.toy_stages import Watch

RECIPE = """\
seed = 0

[[stage]]
name = "eyes"
kind = "shipped"
policy = "route-only"
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        (tmp_path / "recipe.toml").write_text(text, encoding="utf-8")
        return read_recipe(tmp_path / "recipe.toml")

    return write


def test_it_is_there_as_shipped_and_taken_once(written, tmp_path):
    recipe, output = written(RECIPE), tmp_path / "run"
    assert run_recipe(recipe, output, Watch())
    weights = output / "eyes" / "policy" / WEIGHTS_FILE
    assert weights.read_bytes() == (SHIPPED / "route-only" / WEIGHTS_FILE).read_bytes()
    assert standings(recipe, output)[0].marker.said == "route-only, as shipped"
    again = Watch()
    assert run_recipe(recipe, output, again)
    assert again.begun == []


def test_a_policy_that_is_not_shipped_is_refused_with_the_nearest(written):
    with pytest.raises(RecipeError, match=r"'rout-only'.*did you mean 'route-only'"):
        written(RECIPE.replace("route-only", "rout-only"))
