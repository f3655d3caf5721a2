"""The kinds of stages that a recipe can have, by name: one literal table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from agents.training.recipes.driving import CollectStage, CorrectStage, run_collect, run_correct
from agents.training.recipes.kinds import Product, StageKind
from agents.training.recipes.looking import CacheStage, run_cache
from agents.training.recipes.perceiving import PerceiveStage, run_perceive
from agents.training.recipes.shipped import ShippedStage, run_shipped
from agents.training.recipes.training import PlanStage, TrainStage, run_train

STAGE_KINDS: Mapping[str, StageKind] = MappingProxyType(
    {
        "collect": StageKind(
            summary="the expert drives",
            settings=CollectStage,
            makes=Product.DRIVES,
            takes={},
            run=run_collect,
            drives=True,
        ),
        "correct": StageKind(
            summary="a policy drives, and the expert shows what it would have done",
            settings=CorrectStage,
            makes=Product.DRIVES,
            takes={"learner": Product.POLICY},
            run=run_correct,
            drives=True,
        ),
        "perceive": StageKind(
            summary="a policy's eyes learn to see, alone",
            settings=PerceiveStage,
            makes=Product.POLICY,
            takes={"data": Product.DRIVES, "init_from": Product.POLICY},
            run=run_perceive,
        ),
        "cache": StageKind(
            summary="a policy's eyes look at drives once",
            settings=CacheStage,
            makes=Product.SEEN,
            takes={"eyes": Product.POLICY, "data": Product.DRIVES},
            run=run_cache,
        ),
        "shipped": StageKind(
            summary="a policy that comes with the package",
            settings=ShippedStage,
            makes=Product.POLICY,
            takes={},
            run=run_shipped,
        ),
        "plan": StageKind(
            summary="a planner learns alone, from encoded moments",
            settings=PlanStage,
            makes=Product.POLICY,
            takes={
                "data": Product.DRIVES,
                "init_from": Product.POLICY,
                "eyes": Product.POLICY,
                "seen": Product.SEEN,
            },
            run=run_train,
        ),
        "train": StageKind(
            summary="a whole policy learns, pictures rendered on the way",
            settings=TrainStage,
            makes=Product.POLICY,
            takes={"data": Product.DRIVES, "init_from": Product.POLICY},
            run=run_train,
        ),
    }
)
