"""`PromptInLanguage`: the prompt said as text and shown as a picture with numbered objects."""

from __future__ import annotations

import string
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from di_envs.drawing.told_picture import SIDE_PX, told_picture
from di_envs.drawing.told_text import told_text

TEXT, PICTURE = "prompt_text", "prompt_picture"
LONGEST_TEXT = 8000  # characters; a full prompt takes about half


class PromptInLanguage(gymnasium.ObservationWrapper[dict[str, Any], Any, Mapping[str, Any]]):
    """Adds `prompt_text` and `prompt_picture` to the observation, for language models.

    Both are made of the prompt as it is here: put it outside of wrappers that edit the prompt.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Extends the space.

        Args:
            env: An environment with the observation group `prompt`.

        Raises:
            ValueError: If it has none.
        """
        super().__init__(env)
        space = env.observation_space
        if not isinstance(space, spaces.Dict) or "prompt_present" not in space.spaces:
            raise ValueError(
                "PromptInLanguage says the prompt: make the environment with the observation group "
                "'prompt'."
            )
        self.observation_space = spaces.Dict(
            {
                **space.spaces,
                TEXT: spaces.Text(LONGEST_TEXT, charset=string.printable),
                PICTURE: spaces.Box(0, 255, (SIDE_PX, SIDE_PX, 3), np.uint8),
            }
        )

    def observation(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The observation with both."""
        return {
            **observation,
            TEXT: told_text(observation),
            PICTURE: told_picture(observation),
        }
