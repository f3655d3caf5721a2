"""The console script: it runs the commands, or says in one line why they cannot be loaded."""

from __future__ import annotations

import sys


def main() -> None:
    """Runs the command line and exits with its code."""
    sys.exit(run(sys.argv[1:]))


def run(given: list[str]) -> int:
    """Runs the command line; returns its exit code.

    The version and `doctor` need nothing that could be missing or hidden.

    Args:
        given: The arguments, without the program's name.
    """
    if given == ["--version"]:
        from driveinsight import __version__

        print(f"driveinsight {__version__}")
        return 0
    if given == ["doctor"]:
        from driveinsight.doctor import examine

        return examine()
    try:
        import di_envs  # noqa: F401 (looks where Python would find our packages)
        from leaderboard.commands.cli import main as command
    except ImportError as error:
        print(f"error: {_what_is_wrong(error)}", file=sys.stderr)
        return 2
    return command(given)


def _what_is_wrong(error: ImportError) -> str:
    """Why our packages cannot be loaded, and what to do, in one line."""
    said = " ".join(str(error).split())
    if "comes first" in said:  # of `di_envs.shadowing`, which says what to do
        return said
    return (
        f"{said}: something that DriveInsight needs is missing or broken in {sys.executable}; "
        "`driveinsight doctor` says what, `pip install driveinsight` there brings it"
    )
