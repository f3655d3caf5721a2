"""Drives one route while somebody watches: events as they happen, and a video if wanted."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import gymnasium
from rich.console import Console
from rich.progress import Progress

from agents.base import Agent, Requirements
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.suites import choose_suite
from di_envs.world.state import TICK_S
from di_envs.world.world import Event
from leaderboard.records.record import RouteRecord
from leaderboard.running.agent_place import AgentPlace
from leaderboard.running.compiling import compile_progress
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.driver import environment_options
from leaderboard.running.episode import close_agent, drive_route
from leaderboard.running.front_camera import with_front_camera
from leaderboard.running.interventions import (
    Interventions,
    check_interventions,
    seen_space,
    sort_interventions,
    texts_of,
)
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.setting_up import made_agent
from leaderboard.running.video import VideoWriter, open_video
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.running.warm_up import warm_up
from leaderboard.scoring.names import EVENT_NAMES

Watch = Callable[[Mapping[str, Any], dict[str, Any]], None]  # info, observation
_SUITE_OPTIONS = ("town", "routes", "signals", "scenarios")


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

    Agent, environment and route are made once: what is warmed up is what drives.

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
        place = AgentPlace(spec, Stopwatch())
        closing.callback(place.close)
        agent, requires = made_agent(spec.agent, place)
        ready = closing.enter_context(_closed_unless_taken(agent))
        spec = _of_one_route(spec, route_id)
        env, edits = _environment(spec, requires, filmed=video is not None, camera=camera)
        closing.callback(env.close)
        for note in env.planned.notes:
            console.print(note, soft_wrap=True, highlight=False, markup=False)
        driver = _edited(edits, agent, spec.agent)
        film = None
        if video is not None:
            film = closing.enter_context(open_video(video, env.metadata["render_fps"]))
        job = Job(index=0, route_id=env.route_ids[0], seed=seed)
        with compile_progress(console):
            warm_up(edits.around(env), driver, job)
            if film is not None:
                env.picture({})
        shown = closing.enter_context(work_bar("driving", "%", console=console))
        # A spectator sees what is there, edited or not
        watched = Watched(env, _spectator(env, shown, film))
        return drive_route(
            edits.around(watched),
            lambda: ready(driver),
            job,
            rules_named(spec.rules),
            requires=requires,
            interventions=texts_of(spec.interventions),
        )


class Watched(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Shows every step's result to a spectator."""

    def __init__(self, env: RouteEnv, watch: Watch) -> None:
        super().__init__(env)
        self._watch = watch

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Resets the environment."""
        observation, info = self.env.reset(**arguments)
        self._watch(info, observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._watch(info, observation)
        return observation, reward, terminated, truncated, info


def event_line(event: Event) -> str:
    """An event as a line: `  12.3 s  red light at (10.0, -4.5)`."""
    name = EVENT_NAMES[event.kind]
    metres = f", {event.value:.1f} m" if event.value else ""
    place = f"({event.x:.1f}, {event.y:.1f})"
    return f"{event.tick * TICK_S:7.1f} s  {name}{metres} at {place}"


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


@contextlib.contextmanager
def _closed_unless_taken(agent: Agent[Any]) -> Iterator[Callable[[Agent[Any]], Agent[Any]]]:
    """Hands the agent over to whoever drives it, and closes it; closes it itself if none does."""
    taken = []

    def take(driver: Agent[Any]) -> Agent[Any]:
        taken.append(driver)
        return driver

    try:
        yield take
    finally:
        if not taken:
            close_agent(agent)


def _of_one_route(spec: RunSpec, route_id: str | None) -> RunSpec:
    """The same with one route to plan."""
    options = spec.options
    try:
        if route_id is None:
            suite = choose_suite(
                options.get("suite"), **{name: options.get(name) for name in _SUITE_OPTIONS}
            )
            town = suite.town_path.stem  # of a file with routes in several
            route_id = suite.specs(town, options.get("route_ids"))[0].route_id
    except (ValueError, OSError) as error:
        raise SetupError(str(error)) from error
    return dataclasses.replace(spec, options={**options, "route_ids": (route_id,)})


def _environment(
    spec: RunSpec, requires: Requirements, *, filmed: bool, camera: bool
) -> tuple[RouteEnv, Interventions]:
    """The run's environment, with the front camera where the film shows it, and the edits."""
    try:
        own = environment_options(spec.options, requires)
        shown = with_front_camera(own) if filmed and camera else own
        env = RouteEnv(render_mode="rgb_array" if filmed else None, **shown)
    except (ValueError, OSError) as error:
        raise SetupError(str(error)) from error
    space: Any = env.observation_space
    if shown["observations"] != own["observations"]:
        space = seen_space(own["observations"], env.config)
    return env, sort_interventions(spec.interventions, space)


def _edited(edits: Interventions, agent: Agent[Any], name: str) -> Agent[Any]:
    """The agent with what is edited inside it."""
    try:
        check_interventions(edits, agent, name)
        return edits.within(agent, name)
    except ValueError as error:
        raise SetupError(str(error)) from error


def _spectator(env: RouteEnv, shown: Progress, film: VideoWriter | None) -> Watch:
    """Tells of events and progress, and films."""
    task = shown.add_task("", total=100.0)

    def watch(info: Mapping[str, Any], observation: dict[str, Any]) -> None:
        for event in info["events"]:
            shown.print(event_line(event), markup=False)
        standing = f"{info['game_time_s']:.1f} s, DS {info['driving_score']:.1f}"
        shown.update(task, completed=info["route_completion"], description=standing)
        if film is not None:
            film.add(env.picture(observation))

    return watch
