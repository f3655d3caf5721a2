"""Saves an episode in the middle, branches it, and goes back: what differs, differs by the branch.

Run it: `python examples/save_branch_restore.py`.
"""

from __future__ import annotations

import hashlib
from typing import Any

import gymnasium
import numpy as np

import di_envs
from agents import load_agent

FULL_BRAKE = np.array([0.0, 0.0, 1.0], np.float32)


def drive(
    env: Any, observation: Any, memory: Any, steps: int, *, brake: bool
) -> tuple[Any, Any, str]:
    """Drives on; returns the last observation, the memory, and a hash of every observation."""
    agent, bits = load_agent("expert"), hashlib.sha256()
    for _ in range(steps):
        seen = {**observation, "world": env.unwrapped.view}
        action, memory = agent.act(seen, memory)
        observation, *_ = env.step(FULL_BRAKE if brake else action)
        for name in sorted(observation):
            bits.update(np.asarray(observation[name]).tobytes())
    return observation, memory, bits.hexdigest()[:12]


def main() -> None:
    """Four seconds of driving, then four seconds in three branches."""
    env = gymnasium.make("DriveInsight-Town05Long-v1", observations=("prompt", "inertial"))
    observation, _ = env.reset(seed=0, options={"route": 3})
    memory = load_agent("expert").start(env.unwrapped.plan, 0)
    observation, memory, _ = drive(env, observation, memory, 40, brake=False)

    # The snapshot holds the world and the memory of every wrapper, a time limit's count as well.
    # The agent's memory is a value: keep it, with the observation, beside the snapshot.
    here = di_envs.save(env), observation, memory
    x, y = env.unwrapped.view.state.x[0], env.unwrapped.view.state.y[0]
    print(f"saved at {env.unwrapped.view.state.tick * 0.05:.1f} s, x {x:.1f} m, y {y:.1f} m")

    hashes = {}
    for name, brake in (("go on", False), ("brake", True), ("go on again", False)):
        snapshot, observation, memory = here
        di_envs.restore(env, snapshot)
        last, _, hashes[name] = drive(env, observation, memory, 40, brake=brake)
        print(f"{name:12}  speed after 4 s: {last['speed'][0]:4.1f} m/s  bits {hashes[name]}")

    print("same branch, same bits:", hashes["go on"] == hashes["go on again"])
    print("other control, other bits:", hashes["go on"] != hashes["brake"])
    env.close()


if __name__ == "__main__":
    main()
