"""Peak memory of an environment, of many in one process, and of an evaluation.

    python benchmarks/memory.py
    python benchmarks/memory.py --parts environments

Each row is a command of its own. What it and the processes that it starts hold is summed every
`EVERY_S`, pages that several share counted once (Linux's proportional set size), and the most is
printed. Each runs once before, uncounted, so that nothing is compiled or parsed; `cold` begins with
empty caches instead. Asserts nothing.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

EVERY_S = 0.05
STEPS = 100
MB = 1024.0  # kB that Linux counts by
_ONE = f"""
import gymnasium, numpy as np
import di_envs
env = gymnasium.make("DriveInsight-Town05Long-v1"{{options}})
env.reset(seed=0)
for _ in range({STEPS}):
    env.step(np.array([0.5, 0.0, 0.0], np.float32))
"""
_MANY = f"""
import numpy as np
import di_envs
env = di_envs.RouteVectorEnv(num_envs={{count}}, suite="town05_long", threads=1{{options}})
env.reset(seed=0)
for _ in range({STEPS}):
    env.step(np.tile(np.array([0.5, 0.0, 0.0], np.float32), ({{count}}, 1)))
"""
_PROMPT = ', observations=("prompt",)'
_EVALUATE = ("-m", "leaderboard", "evaluate", "--suite", "town05_short", "--output", "{folder}/run")
# By part: what a row is called, and what Python is to do
ROWS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "environments": {
        "`import di_envs`": ("-c", "import di_envs"),
        "one environment, prompt": ("-c", _ONE.format(options=_PROMPT)),
        "one, four small cameras, LiDAR, prompt": ("-c", _ONE.format(options="")),
        "one, rig `paper` (4 x 1600x900), LiDAR, prompt": (
            "-c",
            _ONE.format(options=', cameras="paper"'),
        ),
        "64 in one process, prompt": ("-c", _MANY.format(count=64, options=_PROMPT)),
        "64 in one process, cameras, LiDAR, prompt": ("-c", _MANY.format(count=64, options="")),
    },
    "evaluations": {
        "`evaluate --agent expert --workers 1`": (
            *_EVALUATE,
            *("--agent", "expert", "--workers", "1", "--route-ids", "0", "1"),
        ),
        "`evaluate --agent expert --workers 2`": (
            *_EVALUATE,
            *("--agent", "expert", "--workers", "2", "--route-ids", "0", "1"),
        ),
        "`evaluate --agent driveinsight --workers 2`": (
            *_EVALUATE,
            *("--agent", "driveinsight", "--workers", "2", "--route-ids", "0", "1"),
        ),
    },
    "cold": {"one environment, prompt, kernels compiled": ("-c", _ONE.format(options=_PROMPT))},
}


def processes_from(root: int) -> list[int]:
    """A process and all that it started, and those started, still there."""
    parents = dict[int, int]()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:  # it has ended
                continue
            parents[int(entry.name)] = int(fields[1])
    found = [root]
    for process in found:
        found += [child for child, parent in parents.items() if parent == process]
    return found


def held_kb(process: int) -> int:
    """What a process holds, its share of what several hold; 0 if it has ended."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def peak_mb(arguments: tuple[str, ...], cache: Path | None = None) -> float:
    """The most that Python and all that it starts hold at once [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        places = {} if cache is None else {"XDG_CACHE_HOME": str(cache), "HOME": str(cache)}
        command = [sys.executable, *(each.replace("{folder}", folder) for each in arguments)]
        with (Path(folder) / "said").open("w") as said:
            child = subprocess.Popen(
                command, env={**os.environ, **places}, stdout=said, stderr=subprocess.STDOUT
            )
            most = 0
            while child.poll() is None:
                most = max(most, sum(held_kb(process) for process in processes_from(child.pid)))
                time.sleep(EVERY_S)
        if child.returncode != 0:
            sys.exit(f"{' '.join(command)} failed:\n{(Path(folder) / 'said').read_text()}")
    return most / MB


def main() -> None:
    """Prints a row for each command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=ROWS, default=list(ROWS), help="default: all")
    parts = parser.parse_args().parts
    if not Path("/proc/self/smaps_rollup").exists():
        parser.error("what processes hold is read from Linux's /proc, which is not here")
    console = Console(stderr=True)
    print("| what | peak [MB] |\n|---|---:|")
    for part in parts:
        for name, arguments in ROWS[part].items():
            with console.status(name), tempfile.TemporaryDirectory() as empty:
                if part == "cold":
                    peak = peak_mb(arguments, Path(empty))
                else:
                    peak_mb(arguments)
                    peak = peak_mb(arguments)
            print(f"| {name} | {peak:.0f} |", flush=True)


if __name__ == "__main__":
    main()
