"""`driveinsight agents` and `driveinsight suites`: what there is to evaluate."""

from __future__ import annotations

from dataclasses import dataclass

from leaderboard.running.terminal import Terminal


@dataclass(frozen=True, kw_only=True)
class Agents:
    """List the agents that can be named."""

    def run(self) -> int:
        """Prints the list; returns the exit code."""
        from leaderboard.tables.lists import agent_table, scheme_table, zoo_table

        Terminal().print(
            agent_table(),
            zoo_table(),
            scheme_table(),
            "Your own: --agent module:Class or --agent path/to/file.py:Class (see agents/base.py).",
            "Next: driveinsight evaluate --agent expert --suite town05_tiny",
            sep="\n",
            highlight=False,
        )
        return 0


@dataclass(frozen=True, kw_only=True)
class Suites:
    """List the suites of routes that are shipped."""

    def run(self) -> int:
        """Prints the list; returns the exit code."""
        from leaderboard.tables.lists import scenario_table, suite_table

        Terminal().print(
            suite_table(),
            scenario_table(),
            "Your own: --town FILE.xodr --routes FILE.xml --scenarios FILE.json (CARLA's formats).",
            "Next: driveinsight evaluate --agent expert --suite town05_short",
            sep="\n",
            highlight=False,
        )
        return 0
