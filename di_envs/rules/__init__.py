"""Rule sets by name: one file each, listed here; the reward and the leaderboard's score go by them.

To add one, copy `carla_2_1.py`, give it a name of its own, and list it below. A change that can
move a score is a new rule set, never an edit of an old one.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from types import MappingProxyType

from di_envs.rules.carla_1_0 import CARLA_1_0
from di_envs.rules.carla_2_0 import CARLA_2_0
from di_envs.rules.carla_2_1 import CARLA_2_1
from di_envs.rules.di_1_0 import DI_1_0
from di_envs.rules.rule_set import Rules

__all__ = ["CARLA_1_0", "CARLA_2_0", "CARLA_2_1", "DI_1_0", "RULES", "Rules", "rules_named"]

RULES: Mapping[str, Rules] = MappingProxyType(
    {rules.name: rules for rules in (CARLA_1_0, CARLA_2_0, CARLA_2_1, DI_1_0)}
)


def rules_named(name: str) -> Rules:
    """The rules of that name.

    Raises:
        ValueError: If there are none; the message lists those there are.
    """
    if name not in RULES:
        near = difflib.get_close_matches(name, RULES, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(f"unknown rules '{name}'; {hint}known: {', '.join(RULES)}")
    return RULES[name]
