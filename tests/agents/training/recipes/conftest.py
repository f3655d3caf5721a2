"""Recipes of toy stages."""

from __future__ import annotations

import pytest

from agents.training.recipes import recipe as module
from agents.training.recipes.recipe import read_recipe
from tests.agents.training.recipes.toy_stages import TOY, TOY_KINDS


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Reads a text as a recipe of toy stages."""
    monkeypatch.setattr(module, "STAGE_KINDS", TOY_KINDS)

    def read(text=TOY):
        path = tmp_path / "toy.toml"
        path.write_text(text)
        return read_recipe(path)

    return read
