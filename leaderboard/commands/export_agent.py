"""`driveinsight export-agent`: an agent of ours as a file for another simulator's evaluator."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from leaderboard.commands.ending import UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import check_model

EXPORT_AGENT_HELP = """Write a file with which an agent of ours drives in the CARLA Leaderboard.

Examples:
  driveinsight export-agent driveinsight --to carla --output exported
  driveinsight export-agent driveinsight:runs/mine/policy --to carla --output mine

The folder holds agent.py for the Leaderboard's --agent and agent.json for its --agent-config. It
runs here, too, through `--agent carla:`. docs/agents.md says what it asks of CARLA."""


@dataclass(frozen=True, kw_only=True)
class ExportAgent:
    """The arguments of `driveinsight export-agent`."""

    name: Annotated[tyro.conf.Positional[str], says("NAME")]
    """A name or a scheme (see `driveinsight agents`), or path/to/file.py:Class."""

    to: Annotated[Literal["carla"], says("carla", "carla")] = "carla"
    """For whose evaluator."""

    output: Annotated[Path, says("DIR", "exported")] = Path("exported")
    """Folder to be made."""

    trust: bool = False
    """Load an agent's file that holds pickles (sb3:), which runs the code in them."""

    def run(self) -> int:
        """Exports; returns the exit code."""
        check_model(self.name, trust=self.trust)

        from agents import AgentSpecError
        from leaderboard.exporting.carla import AGENT_FILE, SETTINGS_FILE, export_to_carla

        try:
            written = export_to_carla(self.name, self.output)
        except (AgentSpecError, OSError) as error:
            raise UsageError(str(error)) from error
        asked = ", ".join(name.replace("_", " ") for name in written.truths)
        told = f", as it asks CarlaDataProvider for {asked}" if asked else ""
        file, settings = written.folder / AGENT_FILE, written.folder / SETTINGS_FILE
        privileged = "&track=PRIVILEGED" if asked else ""
        say(
            f"Written: {file} and {settings}; track {written.track.name}{told}.",
            "Next, in CARLA: the Leaderboard's --agent and --agent-config",
            "Next, here: driveinsight evaluate --suite town05_tiny --agent "
            + typed(f"carla:{file}?config={settings}{privileged}"),
        )
        return 0
