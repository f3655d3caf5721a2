"""Drives one short route with the expert, and shows what an environment gives at each step.

Run it: `python examples/drive_a_route.py`. The first run compiles the kernels, once.
"""

from __future__ import annotations

import gymnasium

import di_envs  # noqa: F401 (importing it registers the ids)
from agents import load_agent

ROUTE, SEED = "0", 0


def main() -> None:
    """Drives the route to its end."""
    # Without `observations` come cameras and LiDAR too; the expert needs neither.
    env = gymnasium.make("DriveInsight-Town05Short-v1", observations=("prompt", "inertial"))

    # A route is named by its id (a string) or its index (an integer). Equal seeds give equal
    # episodes, bit for bit: traffic, walkers, lights, and the noise of the sensors.
    observation, info = env.reset(seed=SEED, options={"route": ROUTE})
    print(f"route {info['route_id']}; the observation has {', '.join(observation)}")

    # The expert looks at the true state of the world; agents of your own get the observation only.
    # An agent hides nothing: its memory goes in and comes out.
    world = env.unwrapped
    agent = load_agent("expert")
    memory = agent.start(world.plan, SEED)

    total, over, step = 0.0, False, 0
    while not over:
        action, memory = agent.act({**observation, "world": world.view}, memory)
        # An action is throttle 0..1, steer -1..1 (positive is right), brake 0..1.
        observation, reward, terminated, truncated, info = env.step(action)
        total += reward
        over = terminated or truncated
        step += 1
        if step % 50 == 0 or over:
            speed = observation["speed"][0]
            print(
                f"{info['game_time_s']:5.1f} s  {speed:4.1f} m/s  "
                f"{info['route_completion']:5.1f} % done  events: {len(info['events'])}"
            )

    # The reward is the growth of the driving score in metres: the return is the score itself.
    print(f"ended by: {info['finished']}, driving score {info['driving_score']:.1f}")
    print(f"return {total:.1f} m of {world.plan.length_m:.1f} m")
    agent.close()
    env.close()


if __name__ == "__main__":
    main()
