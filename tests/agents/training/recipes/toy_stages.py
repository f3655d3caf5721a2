"""Kinds of stages that take no time: one counts in a file, one adds what others have counted."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field

from agents.training.recipes.kinds import Made, Product, Progress, StageKind


@dataclass(frozen=True, kw_only=True)
class Count:
    """Writes a drive a number, from `first` on."""

    frames: int
    by: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Add:
    """Writes the sum of all drives, and of the policy that it begins with."""

    data: tuple[str, ...]
    init_from: str = ""
    steps: int = 1


def drives_in(folder):
    return sorted((folder / "toy").glob("[0-9]*.npz"))


def run_count(run):
    (run.folder / "toy").mkdir(parents=True, exist_ok=True)
    for done in range(len(drives_in(run.folder)), run.settings.frames):
        if run.stop():
            return None
        number = run.first + done
        (run.folder / "toy" / f"{number:05d}.npz").write_text(f"{number * run.settings.by:g}")
        run.tell(Progress(done=done + 1, total=run.settings.frames, unit="drives"))
    return Made(samples=run.settings.frames, said=f"{run.settings.frames} drives")


def run_add(run):
    parts = [float(path.read_text()) for folder in run.takes["data"] for path in drives_in(folder)]
    parts += [float((f / "policy" / "sum").read_text()) for f in run.takes["init_from"]]
    if run.stop():
        return None
    (run.folder / "policy").mkdir(exist_ok=True)
    (run.folder / "policy" / "sum").write_text(f"{sum(parts) + run.seed:g}")
    return Made(samples=len(parts), said=f"of {len(parts)} numbers")


TOY_KINDS = {
    "count": StageKind(
        summary="counts",
        settings=Count,
        makes=Product.DRIVES,
        takes={},
        run=run_count,
        drives=True,
    ),
    "add": StageKind(
        summary="adds",
        settings=Add,
        makes=Product.POLICY,
        takes={"data": Product.DRIVES, "init_from": Product.POLICY},
        run=run_add,
    ),
}

TOY = """
seed = 3

[[stage]]
name = "first"
kind = "count"
frames = 2

[[stage]]
name = "sum-0"
kind = "add"
data = ["first"]

[[stage]]
rounds = 2

[[stage.each]]
name = "more-{round}"
kind = "count"
frames = 1

[[stage.each]]
name = "sum-{round}"
kind = "add"
data = ["first", "more-*"]
init_from = "sum-{before}"
"""


@dataclass(kw_only=True)
class Watch:
    """Notes what is told; asks to stop once it was asked so often."""

    stop_at: int | None = None
    asked: int = 0
    begun: list[str] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)

    def begins(self, stage, number, of):
        self.begun.append(stage.name)

    def tells(self, progress):
        assert 0 < progress.done <= progress.total

    def ends(self, stage, marker, number, of):
        assert 1 <= number <= of
        assert marker.done
        self.ended.append(stage.name)

    def stop(self):
        self.asked += 1
        return self.asked == self.stop_at

    def compiling(self):
        return nullcontext()
