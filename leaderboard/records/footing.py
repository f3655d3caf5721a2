"""What results rest on beside what was asked for: package versions and the CPU.

Equal settings give equal bits on equal footing only, so whoever replays or pairs says what differs.
"""

from __future__ import annotations

from collections.abc import Mapping

from di_envs.numerics.kernels import cpu_capability
from leaderboard.records.record import RunRecord
from leaderboard.records.versions import package_versions


def footing_here() -> Mapping[str, str]:
    """The footing of this machine: versions by package, and `CPU`."""
    return {**package_versions(), "CPU": cpu_capability()}


def footing_of(run: RunRecord) -> Mapping[str, str]:
    """That of a run."""
    return {**run.versions, "CPU": run.cpu}


def footing_differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """What is not the same, each as `numpy 2.4.6, not 2.3.1`: ours first."""
    names = sorted(ours.keys() | theirs.keys())
    return [
        f"{name} {ours.get(name, 'absent')}, not {theirs.get(name, 'absent')}"
        for name in names
        if ours.get(name) != theirs.get(name)
    ]
