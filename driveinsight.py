"""The command `driveinsight`, outside of the packages whose names another package may have.

CARLA's Python API has packages called `agents` and `leaderboard`, too. Where one of them comes
first none of our commands can be loaded; this can, and says in one line what to put first.
"""

from __future__ import annotations

import sys


def main() -> None:
    """Runs the command line and exits with its code."""
    sys.exit(run())


def run() -> int:
    """Runs the command line; returns its exit code."""
    try:
        import di_envs  # noqa: F401 (looks where Python would find our packages)
    except ImportError as error:
        if error.path is None:  # something is missing, nothing in the way
            raise
        print(f"error: {error}", file=sys.stderr)
        return 2
    from leaderboard.commands.cli import main as command

    return command()


if __name__ == "__main__":
    main()
