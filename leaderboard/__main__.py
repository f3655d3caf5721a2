"""`python -m leaderboard` and the console script `driveinsight`."""

from __future__ import annotations

import sys

from leaderboard.commands.cli import main as run_command


def main() -> None:
    """Runs the command line and exits with its code."""
    sys.exit(run_command())


if __name__ == "__main__":
    main()
