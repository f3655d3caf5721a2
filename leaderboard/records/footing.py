"""What results rest on beside what was asked for: versions of world and packages, and the CPU.

Equal settings give equal bits on equal footing only, so whoever replays, pairs, continues or shares
out a run says what differs. No source is read for it: a renamed module, an edited comment or
another Python is the same footing. What moves a bit raises `WORLD_VERSION`, or an agent's version.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from di_envs.differences import Difference, differences
from di_envs.numerics.kernels import cpu_capability
from leaderboard.records.record import RunRecord
from leaderboard.records.versions import INFORMATION, PACKAGES, WORLD, package_versions

CPU = "CPU"
_ALWAYS = frozenset({WORLD, CPU, *PACKAGES})
_CALLED = {
    "agent_version": "the agent's version",
    "cpu": "the CPU's capability",
    "planned": "the number of routes x seeds",
    "requires": "what the agent requires",
    "routes_hash": "the hash of the routes",
    "town_hash": "the hash of the town's map",
    "world": "what the suite's files hold",
}


def footing_here(agent: str = "") -> Mapping[str, str]:
    """The footing of this machine: versions by package, the world's, and `CPU`.

    Args:
        agent: Specification of the agent that drives; empty where recorded controls do.
    """
    return {**_counting(package_versions(agent)), CPU: cpu_capability()}


def footing_of(run: RunRecord) -> Mapping[str, str]:
    """That of a run."""
    return {**_counting(run.versions), CPU: run.cpu}


def footing_differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """What is not the same below two worlds, each as `numpy 2.4.6, not 2.3.1`: ours first.

    A package that only one of them rests on, such as torch below a driver that learnt, is no
    difference between their worlds.
    """
    shared = _ALWAYS | (ours.keys() & theirs.keys())
    one, other = ({n: each[n] for n in sorted(shared & each.keys())} for each in (ours, theirs))
    return [difference.is_not for difference in differences(one, other)]


def record_differences(first: Any, second: Any, fields: Iterable[str]) -> list[Difference]:
    """What is not the same in two records of one kind: runs, studies, or what workers found.

    Args:
        first: A dataclass; the earlier one.
        second: Another of its kind.
        fields: Names of those to compare. Of `versions`, what is only information is left out.
    """
    one, other = ({name: getattr(each, name) for name in fields} for each in (first, second))
    for values in (one, other):
        if "versions" in values:
            values["versions"] = _counting(values["versions"])
    return differences(one, other, _CALLED)


def _counting(versions: Mapping[str, str]) -> dict[str, str]:
    return {name: version for name, version in versions.items() if name not in INFORMATION}
