"""`driveinsight doctor`: whether all is there that driving needs, and what to do if not."""

from __future__ import annotations

from dataclasses import dataclass

DOCTOR_HELP = """Look whether all is there that driving needs, and say what to do where it is not.

Looks at Python, packages, names that another package may hide, the processor, caches, display and
ffmpeg, and drives one route. Send what it prints along with a report of a fault."""


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """`driveinsight doctor` has no arguments."""

    def run(self) -> int:
        """Looks; returns the exit code, 1 if something is wrong."""
        from driveinsight.doctor import examine  # it runs without us, too: see driveinsight/command

        return examine()
