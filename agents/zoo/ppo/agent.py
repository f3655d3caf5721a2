"""The driver of `ppo`: the model of Stable-Baselines3 that the example trains, shipped."""

from __future__ import annotations

from pathlib import Path

from agents import AGENTS, AgentSpecError
from agents.sb3.agent import Sb3Agent

MODEL_FILE = "ppo.zip"


class PpoAgent(Sb3Agent):
    """Drives with it.

    Args:
        shipped: Its name in the table of agents.

    Raises:
        AgentSpecError: If none is shipped yet, or Stable-Baselines3 is not installed.
    """

    def __init__(self, *, shipped: str) -> None:
        path = Path(__file__).parents[2] / AGENTS[shipped].data / MODEL_FILE
        if not path.is_file():
            raise AgentSpecError(
                f"agent '{shipped}': not trained yet: python examples/train_ppo.py --model "
                f"{MODEL_FILE}, which --agent sb3:{MODEL_FILE} --trust drives"
            )
        super().__init__(str(path))
