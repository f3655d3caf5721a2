"""`driveinsight doctor`: whether all is there that driving needs, and what to do where it is not.

Nothing here is imported before it is looked at, so that this runs where all else fails.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path

OK, NOTE, WRONG = "ok", "note", "WRONG"
# Extras by a package of each, and what they are for
EXTRAS = {
    "policy": ("torch", "the paper's policy, training and explaining"),
    "hub": ("huggingface_hub", "policies from the Hugging Face Hub and to it"),
    "wandb": ("wandb", "Weights & Biases, beside TensorBoard, for a training"),
    "rl": ("stable_baselines3", "models of Stable-Baselines3"),
    "interpret": ("captum", "Captum's attributions"),
    "ray": ("ray", "driving on a cluster"),
    "video": ("imageio_ffmpeg", "MP4 videos without an ffmpeg of the system"),
}
_NAME = re.compile(r"[\w.-]+")
_BOUND = re.compile(r"(>=|<)(\d+)\.(\d+)")


@dataclass(frozen=True)
class Finding:
    """What was looked at, how it stands, what is so, and what to do about it."""

    name: str
    state: str
    said: str
    cure: str = ""


def examine() -> int:
    """Looks at everything and prints it; returns the exit code, 1 if something is wrong."""
    wrong = 0
    for check in CHECKS:
        for found in _looked_at(check):
            print(f"{found.state:<6} {found.name:<11} {found.said}", flush=True)
            if found.cure:
                print(f"{'':<18} -> {found.cure}", flush=True)
            wrong += found.state == WRONG
    print(f"\nWrong: {wrong}." if wrong else "\nAll is well.")
    return 1 if wrong else 0


def _looked_at(check: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """What a check finds; that it cannot be made, where it fails: a doctor falls over nothing."""
    try:
        yield from check()
    except Exception as error:
        name, said = check.__name__.strip("_"), f"{type(error).__name__}: {error}"
        yield Finding(name, WRONG, " ".join(said.split()), "mend what is wrong above first")


def _python() -> Iterator[Finding]:
    said = f"{platform.python_version()}, {sys.executable}"
    try:
        wanted = str(metadata("driveinsight")["Requires-Python"])
    except PackageNotFoundError:
        cure = "pip install driveinsight, or in a copy of the repository: pip install -e ."
        yield Finding("python", OK, said)
        yield Finding("driveinsight", NOTE, "not installed: runs from a copy", cure)
        return
    bounds = {sign: (int(a), int(b)) for sign, a, b in _BOUND.findall(wanted)}
    if bounds[">="] <= sys.version_info[:2] < bounds["<"]:
        yield Finding("python", OK, said)
    else:
        yield Finding("python", WRONG, said, f"use a Python that is {wanted}")
    where = Path(__file__).resolve().parent.parent
    yield Finding("driveinsight", OK, f"{version('driveinsight')}, {where}")


def _packages() -> Iterator[Finding]:
    """Those that are required, then the extras."""
    try:
        needed = [need for need in requires("driveinsight") or () if "extra ==" not in need]
    except PackageNotFoundError:
        needed = []
    lost, there = [], []
    for need in needed:
        found = _NAME.match(need)
        if found and "python_version" not in need:
            with contextlib.suppress(PackageNotFoundError):
                there.append(f"{found[0]} {version(found[0])}")
                continue
            lost.append(found[0])
    if lost:
        cure = f"{sys.executable} -m pip install {' '.join(lost)}"
        yield Finding("packages", WRONG, f"missing: {', '.join(lost)}", cure)
    else:
        yield Finding("packages", OK, ", ".join(there))
    for extra, (module, purpose) in EXTRAS.items():
        if importlib.util.find_spec(module) is None:
            cure = f"if wanted: pip install 'driveinsight[{extra}]'"
            yield Finding("extra", NOTE, f"{extra} is not there: {purpose}", cure)
        else:
            yield Finding("extra", OK, f"{extra}: {purpose}")


def _names() -> Iterator[Finding]:
    """Whether another package hides one of ours."""
    try:
        import di_envs  # noqa: F401 (looks where Python would find our packages)
    except ImportError as error:
        if "comes first" not in str(error):
            raise
        said, _, cure = str(error).partition(". Put ")
        yield Finding("names", WRONG, said, f"put {cure}")
        return
    yield Finding("names", OK, "no other package is called agents or leaderboard")


def _processor() -> Iterator[Finding]:
    from di_envs.numerics.kernels import cpu_capability

    yield Finding("processor", OK, f"{cpu_capability()}, {os.cpu_count()} cores")


def _caches() -> Iterator[Finding]:
    import warnings

    from di_envs.files.caches import ASKED, writable_cache

    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("always")
        folder = writable_cache("kernels")
    if not met and folder is not None:
        yield Finding("caches", OK, f"{folder.parent} (may be deleted at any time)")
        return
    said = str(met[0].message) if met else "none can be written"
    yield Finding("caches", NOTE, said, f"name a folder in the environment variable {ASKED}")


def _displays() -> Iterator[Finding]:
    """Whether a window can be opened: for `render_mode="human"` alone."""
    shown = sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if shown:
        yield Finding("display", OK, 'there is one, for render_mode="human"')
    else:
        cure = 'use render_mode="rgb_array", driveinsight drive --video or driveinsight report'
        yield Finding("display", NOTE, "there is none: no window can be opened", cure)


def _ffmpeg() -> Iterator[Finding]:
    from leaderboard.running.video import VideoError, find_ffmpeg

    try:
        yield Finding("ffmpeg", OK, find_ffmpeg(Path("out.mp4")))
    except VideoError as error:
        said, _, cure = str(error).partition(": pip")
        yield Finding("ffmpeg", NOTE, said, f"if wanted: pip{cure}")


def _route() -> Iterator[Finding]:
    """Drives one, as any evaluation does; the first time it compiles for half a minute."""
    from di_envs.suites import load_suite
    from leaderboard.running.driver import Driver
    from leaderboard.running.jobs import Job, RunSpec

    began_s = time.perf_counter()
    route_id = load_suite("toy").specs()[0].route_id
    with Driver(RunSpec(agent="expert", options={"suite": "toy"})) as driver:
        record = driver.drive(Job(index=0, route_id=route_id, seed=0))
    spent_s = time.perf_counter() - began_s
    said = f"{record.status}, driving score {record.score.driving_score:.1f}, {spent_s:.1f} s"
    if record.status == "Completed":
        yield Finding("one route", OK, said)
    else:
        yield Finding("one route", WRONG, f"{said} {record.reason}", "report this with all above")


CHECKS = (
    *(_python, _packages, _names, _processor),
    *(_caches, _displays, _ffmpeg, _route),
)
