"""How well the eyes see: figures that a driver would ask for, as sums that can be added up.

Only what is in sight of the car is asked for. Who is hidden is neither missed nor a false alarm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray

from agents.driveinsight.heads import CLASS_OF_KIND, Heads, ObjectClass
from agents.driveinsight.perception_losses import IGNORED, PerceptionTargets
from agents.driveinsight.reading import read_seen
from agents.driveinsight.semantics import BevClass, likeliest
from agents.networks.grid import GridConfig
from di_envs.world.kinds import ActorKind

SCORE = 0.3  # from which on somebody counts as found
MATCH_M = 2.0  # within which he must be
# Ranges that figures are about; within the first a cell counts as near
VEHICLES_M, WALKERS_M, SIGNALS_M = 30.0, 15.0, 25.0
_RIDING = (ObjectClass.VEHICLE, ObjectClass.BICYCLE)
_GROUPS = (("vehicles", _RIDING, VEHICLES_M), ("walkers", (ObjectClass.WALKER,), WALKERS_M))
_IOU = {"vehicle": BevClass.VEHICLE, "walker": BevClass.WALKER, "stop": BevClass.STOP,
        "line": BevClass.LINE, "road": BevClass.ROAD}  # fmt: skip

FIGURES: Mapping[str, tuple[str, str]] = {
    **{f"iou_{name}": (f"{name}_both", f"{name}_either") for name in _IOU},
    "iou_vehicle_near": ("vehicle_near_both", "vehicle_near_either"),
    "iou_walker_near": ("walker_near_both", "walker_near_either"),
    "vehicles_found": ("vehicles_hit", "vehicles_true"),
    "vehicles_right": ("vehicles_hit", "vehicles_said"),
    "walkers_found": ("walkers_hit", "walkers_true"),
    "walkers_right": ("walkers_hit", "walkers_said"),
    "speed_error_mps": ("speed_off", "vehicles_hit"),
    "place_error_m": ("place_off", "vehicles_hit"),
    "state_right": ("state_hit", "state_asked"),
    "signal_found": ("signal_hit", "signal_true"),
    "signal_right": ("signal_hit", "signal_said"),
    "line_error_m": ("line_off", "signal_hit"),
}  # what is divided by what


def figures(sums: Mapping[str, float]) -> dict[str, float | None]:
    """The figures that sums of `perception_sums` come to; None where nothing was asked."""
    return {
        name: sums.get(above, 0.0) / sums[below] if sums.get(below) else None
        for name, (above, below) in FIGURES.items()
    }


def perception_sums(heads: Heads, targets: PerceptionTargets, grid: GridConfig) -> Counter[str]:
    """What the figures are made from, summed over moments.

    Args:
        heads: What was said of B moments.
        targets: What is there.
        grid: Of both.
    """
    sums = _overlaps(heads, targets, grid)
    with torch.no_grad():
        seen = read_seen(heads, grid)
    rows = zip(
        seen.objects.cpu().numpy(), targets.objects.cpu().numpy(),
        seen.signals[:, 0].cpu().numpy(), targets.signal.cpu().numpy(), strict=True,
    )  # fmt: skip
    for said, true, signal_said, signal_true in rows:
        for name, classes, range_m in _GROUPS:
            sums.update(_object_sums(name, classes, range_m, said, true))
        sums.update(_signal_sums(signal_said, signal_true))
    return sums


def _overlaps(heads: Heads, targets: PerceptionTargets, grid: GridConfig) -> Counter[str]:
    """Cells that hold a class in both maps, and in either: of all, and of those nearby."""
    said, true = likeliest(heads.semantics), targets.semantics.long()
    step = torch.arange(grid.cells, device=said.device) + 0.5
    x, y = grid.x_min_m + step * grid.cell_x_m, grid.y_min_m + step * grid.cell_y_m
    near = torch.hypot(x[:, None], y) <= VEHICLES_M
    asked = true != IGNORED
    sums = Counter[str]()
    for name, class_ in _IOU.items():
        ours, theirs = (said == int(class_)) & asked, true == int(class_)
        for which, cells in ((name, True), (f"{name}_near", near)):
            sums[f"{which}_both"] = int((ours & theirs & cells).sum())
            sums[f"{which}_either"] = int(((ours | theirs) & cells).sum())
    return sums


def _object_sums(
    name: str,
    classes: tuple[ObjectClass, ...],
    range_m: float,
    said: NDArray[np.float32],
    true: NDArray[np.float32],
) -> dict[str, float]:
    """Who was found, of some classes within a range.

    Who is found is matched from the highest score on, each with the nearest who is left; the range
    is that of the true place for who is missed, and that of the row for a false alarm.
    """
    said = said[(said[:, 8] >= SCORE) & _of(said, classes)]
    true = true[_of(true, classes)]
    free = np.ones(len(true), bool)
    hit = alarms = 0
    place_off = speed_off = 0.0
    for row in said:
        apart = np.where(free, np.hypot(true[:, 0] - row[0], true[:, 1] - row[1]), np.inf)
        best = int(apart.argmin()) if len(apart) else -1
        if best < 0 or apart[best] > MATCH_M:
            alarms += np.hypot(row[0], row[1]) <= range_m
            continue
        free[best] = False
        match = true[best]
        if match[8] > 0.0 and np.hypot(match[0], match[1]) <= range_m:
            hit += 1
            place_off += apart[best]
            speed_off += float(np.hypot(row[5] - match[5], row[6] - match[6]))
    asked = (true[:, 8] > 0.0) & (np.hypot(true[:, 0], true[:, 1]) <= range_m)
    sums: dict[str, float] = {
        f"{name}_hit": hit,
        f"{name}_said": hit + alarms,
        f"{name}_true": int(asked.sum()),
    }
    return {**sums, "place_off": place_off, "speed_off": speed_off} if name == "vehicles" else sums


def _of(rows: NDArray[np.float32], classes: tuple[ObjectClass, ...]) -> NDArray[np.bool_]:
    kinds = [int(kind) for kind, class_ in CLASS_OF_KIND.items() if class_ in classes]
    return np.isin(rows[:, 7].astype(int), kinds) & (rows[:, 7] != ActorKind.ABSENT)


def _signal_sums(said: NDArray[np.float32], true: NDArray[np.float32]) -> dict[str, float]:
    """Whether the governing signal was seen within its range, where, and what it shows.

    Of lights the state is asked; it counts as right where the signal was found, too.
    """
    there, found = true[7] > 0.0, said[7] >= 0.5
    near = np.hypot(*(true if there else said)[:2]) <= SIGNALS_M
    if not near or not (there or found):
        return {}
    sums: dict[str, float] = {"signal_true": int(there), "signal_said": int(found), "signal_hit": 0}
    if there and found:
        sums["signal_hit"] = 1
        sums["line_off"] = float(np.hypot(said[0] - true[0], said[1] - true[1]))
    if there and true[6] == 0.0:
        right = found and said[3:7].argmax() == true[3:7].argmax()
        sums |= {"state_asked": 1, "state_hit": int(right)}
    return sums
