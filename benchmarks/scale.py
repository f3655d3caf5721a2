"""What a cluster costs beside this machine's own processes: a route, a result, a start.

    python benchmarks/scale.py

Drives the same routes by processes of this machine and by Ray on it, with 1, 2 and 4 workers.
`here` is the processor time that the process which shares out jobs and writes results spends on a
route: what a hundred machines wait for if it is too much. `sent` is a result as it comes in.
Seconds by the clock, of all and to the first result, tell on a quiet machine alone.
"""

from __future__ import annotations

import argparse
import io
import pickle
import tempfile
import time
from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from di_envs.suites import load_suite, suite_names
from leaderboard.records.record import RunRecord
from leaderboard.running.jobs import RunSpec
from leaderboard.running.messages import Driven, EngineEvent
from leaderboard.running.runner import evaluate
from leaderboard.running.workers.local_engine import Engine, LocalEngine
from leaderboard.running.workers.ray_engine import RayEngine


@dataclass(kw_only=True)
class Weighed:
    """An engine whose results are weighed as they come in.

    Attributes:
        engine: Which.
        result_bytes: Of each result, as it is sent.
        first_s: By the clock, from the start to the first result.
    """

    engine: Engine
    result_bytes: list[int]
    first_s: float = 0.0

    def run(self, spec: RunSpec, jobs: object) -> Generator[EngineEvent]:
        """Hands its events on."""
        begin = time.perf_counter()
        for event in self.engine.run(spec, jobs):  # type: ignore[arg-type]
            if isinstance(event, Driven):
                self.first_s = self.first_s or time.perf_counter() - begin
                self.result_bytes.append(len(pickle.dumps(event)))
            yield event


def measure(engine: Engine, spec: RunSpec, seeds: int) -> tuple[RunRecord, dict[str, float]]:
    """One run, and what it cost."""
    weighed = Weighed(engine=engine, result_bytes=[])
    with tempfile.TemporaryDirectory() as folder:
        begin, before_s = time.perf_counter(), time.process_time()
        run = evaluate(
            spec,
            range(seeds),
            suite=load_suite(str(spec.options["suite"])),
            folder=Path(folder) / "run",
            engine=weighed,
            console=Console(file=io.StringIO()),
        )
        clock_s = time.perf_counter() - begin
        here_s = time.process_time() - before_s
    routes = len(run.routes)
    return run, {
        "clock": clock_s,
        "first": weighed.first_s,
        "here": here_s / routes * 1e3,
        "sent": sum(weighed.result_bytes) / routes / 1e3,
    }


def main() -> None:
    """Prints a row an engine."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--agent", default="expert", help="default: expert")
    parser.add_argument(
        "--suite", choices=suite_names(), default="town05_tiny", help="default: town05_tiny"
    )
    parser.add_argument("--seeds", type=int, default=1, help="default: 1")
    parser.add_argument("--workers", nargs="+", type=int, default=(1, 2, 4), metavar="N")
    arguments = parser.parse_args()
    if min(arguments.seeds, *arguments.workers) < 1:
        parser.error("--seeds and --workers must be at least 1")
    spec = RunSpec(agent=arguments.agent, options={"suite": arguments.suite})
    console = Console(stderr=True)
    engines: dict[str, Engine] = {"this machine, 1": LocalEngine(workers=1)}
    engines |= {f"Ray, {count}": RayEngine(workers=count) for count in arguments.workers}
    measure(LocalEngine(), replace(spec, options={**spec.options, "route_ids": ("0",)}), 1)
    print("| engine, workers | routes | clock [s] | first [s] | here [ms] | sent [kB] |")
    print("|---|---:|---:|---:|---:|---:|")
    first = None
    for name, engine in engines.items():
        with console.status(name):
            run, cost = measure(engine, spec, arguments.seeds)
        prints = [record.fingerprint() for record in run.routes]
        first = first or prints
        if prints != first:
            raise SystemExit(f"{name}: not the bits of this machine's own process")
        print(
            f"| {name} | {len(run.routes)} | {cost['clock']:.1f} | {cost['first']:.1f} | "
            f"{cost['here']:.1f} | {cost['sent']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
