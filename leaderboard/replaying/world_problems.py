"""What is wrong with the world that a claim names: it is looked up in the files themselves."""

from __future__ import annotations

from collections.abc import Iterator

from agents.base import SENSOR_OPTIONS
from di_envs.suite_files import content_of, suite_of
from leaderboard.records.record import RunRecord


def world_problems(run: RunRecord) -> Iterator[str]:
    """What does not hold, a sentence each.

    A shipped suite is compared with the one that is shipped here, files of the user's own by what
    they hold. No cache is read for it.
    """
    for name in run.requires.get("options", {}):
        if name not in SENSOR_OPTIONS:
            yield f"its agent chose its own benchmark: it asked for {name}"
    try:
        suite = suite_of(run.options)
        content = content_of(suite)
    except (ValueError, OSError) as error:
        yield f"its world cannot be looked up here: {error}"
        return
    claimed, found = _named(run.suite, run.suite_version), _named(suite.name, suite.version)
    if claimed != found:
        yield f"suite {claimed} is claimed, its options choose {found} here"
    if not run.world:
        yield (
            "it does not name its world by what the files hold, as runs of earlier versions: "
            "evaluate again"
        )
        return
    for name in sorted(run.world.keys() | content.keys()):
        given, there = run.world.get(name, "nothing"), content.get(name, "nothing")
        if given != there:
            yield f"its {name} is not the one here: it was driven with {given}, here is {there}"


def _named(name: str, version: int) -> str:
    return f"'{name}' version {version}" if version else f"'{name}' of files of the user's own"
