"""The prompt in language: the text and the picture are in their spaces, and of what is told."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import ImageColor

from di_envs.drawing.outlines import ACTOR, EGO
from di_envs.drawing.told_picture import EGO_PX, PIXELS_A_METRE, told_picture
from di_envs.route_env import RouteEnv
from di_envs.world.kinds import ActorKind
from wrappers.language import PICTURE, TEXT, PromptInLanguage


def colour_at(picture, ahead_m, right_m):
    column, row = EGO_PX[0] + PIXELS_A_METRE * right_m, EGO_PX[1] - PIXELS_A_METRE * ahead_m
    return tuple(picture[round(row), round(column)].tolist())


def test_a_prompt_in_language_is_in_its_space():
    env = PromptInLanguage(RouteEnv(suite="toy", observations=("prompt",), traffic=6, walkers=3))
    observation, _ = env.reset(seed=4, options={"route": 0})
    assert env.observation_space.contains(observation)
    assert "obstacles: " in observation[TEXT]
    assert colour_at(observation[PICTURE], 0.0, 0.0) == ImageColor.getrgb(EGO)
    env.close()


def test_a_numbered_object_is_where_the_prompt_has_it_and_gone_where_it_is_not_given():
    env = RouteEnv(suite="toy", observations=("prompt",), traffic=0, walkers=0)
    seen, _ = env.reset(seed=4, options={"route": 0})
    seen["obstacles"][0] = (20.0, -6.0, 0.0, 4.5, 1.9, 0.0, 0.0, int(ActorKind.VAN), 1.0)
    van = ImageColor.getrgb(ACTOR[ActorKind.VAN])
    assert colour_at(told_picture(seen), 20.0, -6.0) == van
    seen["prompt_present"][:] = 0
    assert np.unique(told_picture(seen).reshape(-1, 3), axis=0).shape[0] <= 4  # the ego alone
    env.close()


def test_without_a_prompt_there_is_nothing_to_say():
    with pytest.raises(ValueError, match="observation group 'prompt'"):
        PromptInLanguage(RouteEnv(suite="toy", observations=("inertial",)))
