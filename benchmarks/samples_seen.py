"""What the weights of a shipped policy or system have learnt from, by its recipe."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from agents.training.recipes.recipe import Stage, read_recipe

RECIPES = Path(__file__).resolve().parents[1] / "recipes"
_WITH_PICTURES = {"train": True, "perceive": True, "plan": False}  # kinds of stages that teach
_BEGINS_WITH = ("init_from", "eyes")  # fields that name the stages whose weights one goes on with


class SamplesSeen(NamedTuple):
    """Moments learnt from, each as often as it was drawn."""

    pictures: int  # rendered for the eyes, or for the whole network
    planned: int  # by a planner alone, from what it is told and what eyes have seen

    def __str__(self) -> str:
        return f"{self.pictures:,}" + (f" + {self.planned:,}" if self.planned else "")


def samples_seen(name: str) -> SamplesSeen | None:
    """Of a stage of that name and all whose weights it begins with; None without a recipe.

    So a teacher's samples count where its weights are taken over; of eyes that another recipe has
    trained nothing is known here.
    """
    for path in sorted(RECIPES.glob("*.toml")):
        stages = {stage.name: stage for stage in read_recipe(path).stages}
        if name in stages and stages[name].kind in _WITH_PICTURES:
            return _summed(stages, name)
    return None


def _summed(stages: dict[str, Stage], name: str) -> SamplesSeen:
    found = dict.fromkeys(_WITH_PICTURES.values(), 0)
    begun, left = set[str](), [name]
    while left:
        stage = stages[left.pop()]
        if stage.name in begun or stage.kind not in _WITH_PICTURES:
            continue
        begun.add(stage.name)
        left += [taken for key in _BEGINS_WITH for taken in stage.takes.get(key, ())]
        how = stage.settings
        found[_WITH_PICTURES[stage.kind]] += how.steps * how.batch * getattr(how, "length", 1)
    return SamplesSeen(pictures=found[True], planned=found[False])
