"""`driveinsight warm-up`: compiles and reads beforehand what first runs would wait for."""

from __future__ import annotations

import time
from dataclasses import dataclass

from leaderboard.running.terminal import Terminal

WARM_UP_HELP = """Compile the kernels, read the shipped maps, plan their routes: nobody waits later.

For images of containers, CI, and whoever would rather wait now: once for a version, a CPU and a
Python. What is in the caches already is not done again. DRIVEINSIGHT_CACHE says where they are."""


@dataclass(frozen=True, kw_only=True)
class WarmUp:
    """`driveinsight warm-up` has no arguments."""

    def run(self) -> int:
        """Does it; returns the exit code, 1 if nothing can be kept."""
        from di_envs.files.caches import writable_cache
        from leaderboard.running.compiling import compile_progress
        from leaderboard.running.warming import WORKS

        console, folder = Terminal(), writable_cache("kernels")
        if folder is None:  # a warning has said so, and what to do
            return 1
        for what, work in WORKS.items():
            begin = time.perf_counter()
            with compile_progress(console):
                work()
            console.print(f"{what}: {time.perf_counter() - begin:.1f} s", highlight=False)
        console.print(f"All is in {folder.parent}.", highlight=False)
        return 0
