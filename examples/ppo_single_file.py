"""Proximal policy optimisation in one file, from the worlds to an agent that is scored.

    python examples/ppo_single_file.py                        # crossings of Town05, 300,000 steps
    python examples/ppo_single_file.py --env DriveInsight-Toy-v1 --steps 100000
    driveinsight evaluate --agent pickled:policies/… --suite town05_tiny --trust    # as it prints

All that learns is here, to be read from top to bottom and changed: no library but torch. The worlds
are stepped together (`gymnasium.make_vec`), and what they see comes as one array (`preset="flat"`),
so nothing here loops over worlds. It needs torch: `pip install -c constraints.txt -e ".[policy]"`.

Source: Schulman et al., Proximal Policy Optimization Algorithms, arXiv 1707.06347, 2017, with
advantages of Schulman et al., High-Dimensional Continuous Control Using Generalized Advantage
Estimation, ICLR 2016; rewards scaled as Gymnasium's `NormalizeReward` does.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
import tyro
from gymnasium.wrappers.vector import NormalizeReward
from rich.progress import Progress
from torch import Tensor, nn
from torch.distributions import Normal

import di_envs  # noqa: F401 (registers the ids)
from agents.learned import LearnedAgent
from agents.pickled import keep_agent
from wrappers.actions import pedal_vector

FIRST_SEED = 1_000_000  # no world of an evaluation is among those from here on
ENDS = ("collision_vehicle", "collision_walker", "collision_static", "red_light")
RECENT = 100  # episodes whose scores are shown


@dataclass(frozen=True, kw_only=True)
class Training:
    """What to train, and for how long."""

    env: str = "DriveInsight-Town05Tiny-v1"
    """Id of the environment."""

    folder: Path = Path("policies")
    """Where the agent goes."""

    steps: int = 300_000
    """Decisions in all worlds together."""

    worlds: int = 64
    """Driven at once."""

    threads: int = 2
    """For the worlds; networks so small have one."""

    seed: int = 0
    """Of the networks and of the worlds."""

    traffic: int | None = None
    """Number of other vehicles; the suite's where none is given."""

    walkers: int | None = None
    """Number of people on foot; the suite's where none is given."""

    control_dt_s: float = 0.2
    """How long an action is held."""

    rollout: int = 64
    """Decisions of each world between two updates of the networks."""

    epochs: int = 4
    """Passes over a rollout's decisions."""

    batch: int = 512
    """Decisions in a step of the optimiser."""

    learning_rate: float = 1e-3
    """At first; it falls to a tenth."""

    discount: float = 0.99
    """Of a reward, for each decision that it is away."""

    decay: float = 0.95
    """Of what later errors of the value say about an action: the lambda of its advantage."""

    clip: float = 0.2
    """How far an action's probability may move while the same rollout is learned from."""


class Policy(nn.Module):
    """Two small networks: what to do, (N, numbers) to (N, 2), and what is still to be gained."""

    def __init__(self, numbers: int, width: int = 64) -> None:
        super().__init__()
        self.actor, self.critic = _network(numbers, width, 2), _network(numbers, width, 1)
        self.log_std = nn.Parameter(torch.full((2,), -1.0))
        with torch.no_grad():
            self.actor[-1].weight.mul_(0.01)
            self.actor[-1].bias[0] = 0.5  # drives off rather than brakes before it has learned

    def forward(self, seen: Tensor) -> tuple[Normal, Tensor]:
        """The distribution of (N, 2) actions, pedal and wheel, and the (N,) values."""
        return Normal(self.actor(seen), self.log_std.exp()), self.critic(seen)[:, 0]

    def __call__(self, seen: Tensor) -> Any:
        """As `forward`."""
        return super().__call__(seen)


def _network(inputs: int, width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        *(nn.Linear(inputs, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()),
        nn.Linear(width, outputs),
    )


@dataclass(frozen=True)
class Driver:
    """The most likely action, as the leaderboard asks for it: one observation, one action."""

    policy: Policy

    def __call__(self, seen: Any) -> Any:
        """(numbers,) to (2,)."""
        return self.policy.actor(torch.as_tensor(seen)).detach().numpy()


class Rollout(NamedTuple):
    """T decisions of N worlds."""

    seen: Tensor  # (T, N, numbers)
    actions: Tensor  # (T, N, 2)
    log_probs: Tensor  # (T, N) of the actions, as they were chosen
    values: Tensor  # (T, N)
    rewards: Tensor  # (T, N) scaled
    going: Tensor  # (T, N) 0 where the episode ended with this decision


@dataclass(kw_only=True)
class Progressing:
    """How training goes.

    Attributes:
        steps: Decisions so far.
        scores: Driving scores of the episodes that ended last.
        losses: Mean squared error of the value in each update, of scaled returns.
        seconds: By the clock, of each part of the work.
    """

    steps: int = 0
    scores: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT))
    losses: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(PARTS, 0.0))

    @contextmanager
    def doing(self, part: str) -> Iterator[None]:
        """Adds up what a part of the work takes."""
        begin = time.perf_counter()
        yield
        self.seconds[part] += time.perf_counter() - begin

    @property
    def score(self) -> float:
        """Mean of the last scores; 0 before the first."""
        return sum(self.scores) / max(len(self.scores), 1)

    @property
    def rate(self) -> float:
        """Decisions a second, everything counted."""
        return self.steps / max(sum(self.seconds.values()), 1e-9)


PARTS = ("worlds", "deciding", "learning")


def make_worlds(training: Training) -> NormalizeReward:
    """The worlds: flat observations, one pedal, rewards divided by how much returns vary."""
    chosen = {"traffic": training.traffic, "walkers": training.walkers}
    envs = gymnasium.make_vec(
        training.env,
        num_envs=training.worlds,
        threads=training.threads,
        autoreset_mode="SameStep",
        observations=("prompt",),
        preset="flat",
        control_dt_s=training.control_dt_s,
        terminate_on=ENDS,  # what an infraction costs is the rest of the route: easy to learn
        **{name: number for name, number in chosen.items() if number is not None},
    )
    return NormalizeReward(pedal_vector(envs), gamma=training.discount)


def collect(
    envs: NormalizeReward, policy: Policy, seen: Tensor, training: Training, told: Progressing
) -> tuple[Rollout, Tensor]:
    """Drives on from what is seen (N, numbers); returns the decisions, and what is seen then."""
    steps = []
    for _ in range(training.rollout):
        with told.doing("deciding"), torch.no_grad():
            chances, values = policy(seen)
            actions = chances.sample()
            log_probs = chances.log_prob(actions).sum(1)
        with told.doing("worlds"):
            after, rewards, terminated, truncated, info = envs.step(actions.clamp(-1, 1).numpy())
        ended = terminated | truncated
        if ended.any():
            told.scores.extend(info["final_info"]["driving_score"][ended].tolist())
            rewards = rewards + _cut_short(policy, info, truncated & ~terminated, training)
        going = torch.as_tensor(~ended).float()
        rewards = torch.as_tensor(rewards).float()
        steps.append((seen, actions, log_probs, values, rewards, going))
        seen = torch.as_tensor(after)
    told.steps += training.rollout * training.worlds
    return Rollout(*(torch.stack(part) for part in zip(*steps, strict=True))), seen


def _cut_short(policy: Policy, info: Any, which: Any, training: Training) -> Any:
    """(N,) what an episode that ran out of time would still have gained, for those; else 0."""
    gained = np.zeros(which.size)
    if which.any():
        last = torch.as_tensor(np.stack(info["final_obs"][which].tolist()))
        with torch.no_grad():
            gained[which] = training.discount * policy.critic(last)[:, 0].numpy()
    return gained


def advantages_of(rollout: Rollout, following: Tensor, training: Training) -> Tensor:
    """(T, N) how much better each action was than expected; `following` (N,) values after all."""
    found, so_far = torch.zeros_like(rollout.rewards), torch.zeros_like(following)
    for t in reversed(range(len(found))):
        error = rollout.rewards[t] + training.discount * following * rollout.going[t]
        error = error - rollout.values[t]
        so_far = error + training.discount * training.decay * rollout.going[t] * so_far
        found[t], following = so_far, rollout.values[t]
    return found


def learn(
    policy: Policy,
    optimiser: torch.optim.Optimizer,
    rollout: Rollout,
    advantages: Tensor,
    training: Training,
) -> float:
    """Some passes over a rollout, in batches; returns the mean squared error of the value."""
    returns = (advantages + rollout.values).flatten()
    advantages = ((advantages - advantages.mean()) / (advantages.std() + 1e-8)).flatten()
    seen, actions, before = (part.flatten(0, 1) for part in rollout[:3])
    errors: list[float] = []
    for _ in range(training.epochs):
        for chosen in torch.randperm(len(returns)).split(training.batch):
            chances, values = policy(seen[chosen])
            ratio = (chances.log_prob(actions[chosen]).sum(1) - before[chosen]).exp()
            bounded = ratio.clamp(1.0 - training.clip, 1.0 + training.clip)
            gain = torch.min(ratio * advantages[chosen], bounded * advantages[chosen]).mean()
            error = (values - returns[chosen]).square().mean()
            optimiser.zero_grad()
            (0.5 * error - gain).backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
            optimiser.step()
            errors.append(float(error.detach()))
    return sum(errors) / len(errors)


def train(training: Training, bar: Progress | None = None) -> tuple[Policy, Progressing]:
    """Trains a policy from nothing; says on a bar how it goes, if there is one."""
    torch.set_num_threads(1)  # its others, while they wait, would keep a core from the worlds
    torch.manual_seed(training.seed)
    envs = make_worlds(training)
    policy, told = Policy(envs.single_observation_space.shape[0]), Progressing()
    optimiser = torch.optim.Adam(policy.parameters(), lr=training.learning_rate, eps=1e-5)
    task = None if bar is None else bar.add_task("training", total=training.steps)
    first, _ = envs.reset(seed=FIRST_SEED + training.seed * training.worlds)
    seen = torch.as_tensor(first)
    while told.steps < training.steps:
        left = 1.0 - told.steps / training.steps
        optimiser.param_groups[0]["lr"] = training.learning_rate * (0.1 + 0.9 * left)
        rollout, seen = collect(envs, policy, seen, training, told)
        with told.doing("learning"):
            with torch.no_grad():
                following = policy.critic(seen)[:, 0]
            advantages = advantages_of(rollout, following, training)
            told.losses.append(learn(policy, optimiser, rollout, advantages, training))
        if bar is not None and task is not None:
            said = f"DS {told.score:.1f}, {told.rate:,.0f} steps/s"
            bar.update(task, completed=told.steps, description=said)
    envs.close()
    return policy, told


def main(training: Training) -> None:
    """Trains, says how it went, and keeps the agent."""
    with Progress() as bar:
        policy, told = train(training, bar)
    shares = ", ".join(
        f"{part} {100.0 * seconds / sum(told.seconds.values()):.0f} %"
        for part, seconds in told.seconds.items()
    )
    print(f"{told.steps:,} steps, {told.rate:,.0f} a second by the clock: {shares}")
    print(f"error of the value: first update {told.losses[0]:.4f}, last {told.losses[-1]:.4f}")
    print(f"driving score of the last {len(told.scores)} episodes in training: {told.score:.1f}")
    agent = keep_agent(
        LearnedAgent(Driver(policy), control_dt_s=training.control_dt_s), training.folder
    )
    print(f"Next: driveinsight evaluate --agent {agent} --suite town05_tiny --trust")


if __name__ == "__main__":
    main(tyro.cli(Training, description=__doc__))
