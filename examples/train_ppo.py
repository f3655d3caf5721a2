"""Trains PPO on single crossings from the prompt, and saves a model that the leaderboard scores.

    python examples/train_ppo.py                     # writes ppo.zip and ppo.monitor.csv
    tensorboard --logdir ppo.tensorboard             # while it learns, where it is installed
    driveinsight evaluate --agent sb3:ppo.zip --suite town05_tiny --trust

It needs Stable-Baselines3: `pip install -c constraints.txt -e ".[rl]"`. Seeds of training begin at
1,000,000 so that no world of an evaluation is among them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import gymnasium
import torch
import tyro
from rich.progress import Progress
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import di_envs  # noqa: F401 (registers the ids)
from agents.training.board import Tell, board
from wrappers.actions import pedal_vector
from wrappers.prompt_features import PromptFeatures
from wrappers.sb3 import Sb3VecEnv

FIRST_SEED = 1_000_000
CONTROL_DT_S = 0.2  # half as many decisions as by default for the same metres
ENDS = ("collision_vehicle", "collision_walker", "collision_static", "red_light")


@dataclass(frozen=True, kw_only=True)
class Training:
    """What to train, and for how long."""

    model: Path = Path("ppo.zip")
    """Where the model goes; the episodes' returns go beside it."""

    steps: int = 300_000
    """Decisions in all worlds together."""

    rollout: int = 4096
    """Decisions between two updates of the networks."""

    worlds: int = 32
    """Driven at once, in threads."""

    threads: int = 2
    """For the worlds and for torch."""

    seed: int = 0
    """Of the network and of the worlds."""

    traffic: int = 120
    """Number of other vehicles."""

    wandb: str = ""
    """Project of Weights & Biases that is told how it goes, beside TensorBoard; empty for none."""


def make_worlds(training: Training) -> VecNormalize:
    """The worlds, as Stable-Baselines3 takes them."""
    envs = gymnasium.make_vec(
        "DriveInsight-Town05Tiny-v1",
        num_envs=training.worlds,
        threads=training.threads,
        autoreset_mode="SameStep",
        observations=("prompt",),
        preset="flat",
        control_dt_s=CONTROL_DT_S,
        terminate_on=ENDS,  # what an infraction costs is the rest of the route: easy to learn
        traffic=training.traffic,
    )
    worlds = Sb3VecEnv(pedal_vector(envs))
    worlds.seed(FIRST_SEED + training.seed * training.worlds)
    log = str(training.model.with_suffix(""))
    scores = ("driving_score", "route_completion", "finished")
    return VecNormalize(VecMonitor(worlds, log, info_keywords=scores), norm_obs=False, gamma=0.99)


def make_learner(worlds: VecNormalize, training: Training) -> PPO:
    """PPO with small networks, that drives off rather than brakes before it has learned."""
    learner = PPO(
        "MlpPolicy",
        worlds,
        n_steps=training.rollout // training.worlds,
        batch_size=512,
        n_epochs=6,
        gamma=0.99,
        learning_rate=LinearSchedule(6e-4, 6e-5, 1.0),
        policy_kwargs={
            "features_extractor_class": PromptFeatures,
            "net_arch": [128, 128],
            "log_std_init": -1.0,
        },
        seed=training.seed,
        device="cpu",
    )
    with torch.no_grad():
        learner.policy.action_net.bias[0] = 0.5  # light throttle
    # What the spaces do not tell whoever scores the model: how long an action was held.
    learner.driveinsight_options = {"control_dt_s": CONTROL_DT_S}
    return learner


class Bar(BaseCallback):
    """Shows how far training is, and how well the last hundred episodes were driven."""

    def __init__(self, tell: Tell) -> None:
        super().__init__()
        self._tell = tell

    def _on_training_start(self) -> None:
        self._bar = Progress()
        self._bar.start()
        self._task = self._bar.add_task("training", total=self.locals["total_timesteps"])

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        scores = [episode["driving_score"] for episode in self.model.ep_info_buffer or ()]
        text = f"DS {sum(scores) / len(scores):.1f}" if scores else ""
        losses = {name: float(x) for name, x in self.logger.name_to_value.items()}
        driven = {"driving_score": sum(scores) / len(scores)} if scores else {}
        self._tell({"step": self.num_timesteps, **losses, **driven})
        self._bar.update(self._task, completed=self.num_timesteps, description=f"training {text}")

    def _on_training_end(self) -> None:
        self._bar.stop()


def main(training: Training) -> None:
    """Trains, with a progress bar, and saves."""
    torch.set_num_threads(training.threads)
    worlds = make_worlds(training)
    learner = make_learner(worlds, training)
    place = training.model.with_suffix(".tensorboard")
    with board(place, project=training.wandb, about=vars(training)) as tell:
        learner.learn(training.steps, callback=Bar(tell))
    learner.save(training.model)
    worlds.close()
    print(f"Written: {training.model} and {training.model.with_suffix('.monitor.csv')}")
    print(f"Next: driveinsight evaluate --agent sb3:{training.model} --suite town05_tiny --trust")


if __name__ == "__main__":
    main(tyro.cli(Training, description=__doc__))
