"""Drives one route while somebody watches: events as they happen, and a video if wanted."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
from gymnasium import spaces
from rich.console import Console
from rich.markup import escape

from agents.base import Requirements
from di_envs.observation import observation_space
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.world.state import TICK_S
from di_envs.world.world import Event
from leaderboard.records.record import RouteRecord
from leaderboard.running.compiling import compile_progress
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.driver import environment_options
from leaderboard.running.episode import drive_route
from leaderboard.running.interventions import sort_interventions
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.video import open_video
from leaderboard.running.warm_up import warm_up
from leaderboard.scoring.names import EVENT_NAMES

Watch = Callable[[Mapping[str, Any], dict[str, Any]], None]  # info, observation


def drive(
    spec: RunSpec,
    *,
    route_id: str | None = None,
    seed: int = 0,
    console: Console,
    video: Path | None = None,
    camera: bool = True,
) -> RouteRecord:
    """Drives one route, exactly as `evaluate` does with this route and seed.

    Args:
        spec: The agent, the environment's options and the rules.
        route_id: The route; None for the first.
        seed: As `evaluate` counts them.
        console: Where events and progress are shown.
        video: A file to write a video to; `open_video` says which formats there are.
        camera: Whether the video shows the front camera too. The agent is not shown it by that.

    Raises:
        SetupError: If the agent or an option is wrong.
        VideoError: If the video cannot be written.
    """
    with contextlib.ExitStack() as closing:
        scene = warm_up(spec, console)
        env = _environment(spec, scene.requires, filmed=video is not None, camera=camera)
        closing.callback(env.close)
        fps = env.metadata["render_fps"]
        film = None if video is None else closing.enter_context(open_video(video, fps))
        job = Job(index=0, route_id=route_id or scene.route_ids[0], seed=seed)
        if film is not None:
            with compile_progress(console):  # cameras that the agent itself does not need
                first, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
                env.picture(first)
        shown = closing.enter_context(work_bar("driving", "%", console=console))
        task = shown.add_task("", total=100.0)

        def watch(info: Mapping[str, Any], observation: dict[str, Any]) -> None:
            for event in info["events"]:
                shown.print(event_line(event))
            standing = f"{info['game_time_s']:.1f} s, DS {info['driving_score']:.1f}"
            shown.update(task, completed=info["route_completion"], description=standing)
            if film is not None:
                film.add(env.picture(observation))

        groups = _groups(spec, scene.requires)
        keys = observation_space(groups, env.config.cameras, env.config.lidar).keys()
        watched = Watched(env, watch, keys)  # a spectator sees what is there, edited or not
        edits = sort_interventions(spec.interventions, watched.observation_space)
        return drive_route(
            edits.around(watched),
            lambda: edits.agent(spec.agent),
            job,
            rules_named(spec.rules),
            requires=scene.requires,
            interventions=spec.interventions,
        )


class Watched(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Shows every step's result to a spectator, and the agent no more than its observation."""

    def __init__(self, env: RouteEnv, watch: Watch, keys: Iterable[str]) -> None:
        super().__init__(env)
        self._watch, self._keys = watch, frozenset(keys)
        shown: Any = env.observation_space
        own = {key: part for key, part in shown.items() if key in self._keys}
        self.observation_space = spaces.Dict(own)

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Resets the environment."""
        observation, info = self.env.reset(**arguments)
        self._watch(info, observation)
        return self._own(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._watch(info, observation)
        return self._own(observation), reward, terminated, truncated, info

    def _own(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in observation.items() if key in self._keys}


def event_line(event: Event) -> str:
    """An event as a line: `  12.3 s  red light at (10.0, -4.5)`."""
    name = EVENT_NAMES[event.kind]
    metres = f", {event.value:.1f} m" if event.value else ""
    place = f"({event.x:.1f}, {event.y:.1f})"
    return escape(f"{event.tick * TICK_S:7.1f} s  {name}{metres} at {place}")


def record_lines(record: RouteRecord) -> list[str]:
    """How the route went, in lines to print."""
    score, bound = record.score, record.bound
    lines = [
        f"Route {record.route_id}, seed {record.seed}: {record.status}",
        f"  driving score   {score.driving_score:.2f} = route completion "
        f"{score.route_completion:.2f} x infraction score {score.infraction_score:.2f}",
    ]
    if record.reason:
        lines.insert(1, f"  {record.reason}")
    if bound is not None:
        lines.append(f"  lights allow    {bound.route_completion:.2f} without traffic")
    lines.append(
        f"  took            {record.game_s:.1f} s of driving, {record.wall_s:.1f} s of ours"
    )
    return lines


def _groups(spec: RunSpec, requires: Requirements) -> tuple[str, ...]:
    groups: tuple[str, ...] = environment_options(spec.options, requires)["observations"]
    return tuple(groups)


def _environment(spec: RunSpec, requires: Requirements, *, filmed: bool, camera: bool) -> RouteEnv:
    """The run's environment; with the front camera where the film shows it."""
    options = environment_options(spec.options, requires)
    groups = _groups(spec, requires)
    if filmed and camera and "camera" not in groups:
        options["observations"] = (*groups, "camera")
        cameras = rig_of(options.get("cameras", "small")).cameras
        front = [camera for camera in cameras if camera.name == "camera_front"]
        options["cameras"] = Rig(cameras=tuple(front or cameras[:1]))
    try:
        return RouteEnv(render_mode="rgb_array" if filmed else None, **options)
    except (ValueError, OSError) as error:
        raise SetupError(str(error)) from error
