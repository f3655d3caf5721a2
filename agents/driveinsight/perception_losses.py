"""What training of the eyes brings down: what the heads say against what truly is there.

Source: the focal loss of heatmaps, Law and Deng, CornerNet, ECCV 2018; Zhou et al., Objects as
Points, 2019. Who is there but hidden from the car is neither asked for nor held against it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.driveinsight.heads import BOX, CLASS_OF_KIND, SPEED_MPS, Heads, ObjectClass
from agents.driveinsight.semantics import CLASS_WEIGHTS
from agents.networks.grid import GridConfig
from di_envs.world.kinds import ActorKind

IGNORED = 255  # class of a cell that nothing is asked of
OTHERS = 10.0  # added to the state of a lamp that does not govern the ego's lane
_SPREAD = 0.35  # of an object's sides, the standard deviation of its peak …
_LEAST_SPREAD_M, _MOST_SPREAD_M = 0.6, 1.6  # … within these
_BESIDE = 1  # cells round a middle that tell the box, too
# Of a box: offset, log size, heading, velocity
_BOX_WEIGHTS = (1.0, 1.0, 0.5, 0.5, 1.0, 1.0, 2.0, 2.0)


@dataclass(frozen=True, kw_only=True)
class PerceptionWeights:
    """Weights of the terms; 0 leaves one out."""

    semantics: float = 1.0
    heat: float = 1.0
    boxes: float = 1.0
    where: float = 0.3
    line: float = 0.3
    state: float = 0.5
    lamps: float = 0.5
    depth: float = 0.1


@dataclass(frozen=True, kw_only=True)
class PerceptionTargets:
    """What truly is there at B moments.

    Attributes:
        semantics: (B, X, Y) uint8 `BevClass`, or `IGNORED`.
        objects: (B, M, 9) rows of `truth`; zeros for nobody, and 0 in the last column for those
            who are hidden.
        signal: (B, 8) the governing signal; zeros for none.
        lamps: (B, K, 3) where in the image that sees lamps best they are: row and column [its
            pixels / 4], and state 0 to 3, of those that do not govern `OTHERS` more; -1 for none.
            None without cameras.
        depth: For each size of image (B, N, h, w) index of the depth bin, -1 for none.
    """

    semantics: Tensor
    objects: Tensor
    signal: Tensor
    lamps: Tensor | None
    depth: tuple[Tensor, ...] = ()


def perception_losses(
    heads: Heads,
    depth: Sequence[Tensor],
    targets: PerceptionTargets,
    grid: GridConfig,
    weights: PerceptionWeights,
) -> dict[str, Tensor]:
    """The terms by name, weighted, and their sum as `total`."""
    classes = torch.tensor(CLASS_WEIGHTS, device=heads.semantics.device)
    terms = {
        "semantics": F.cross_entropy(
            heads.semantics.float(), targets.semantics.long(), classes, ignore_index=IGNORED
        ),
        **_object_terms(heads, targets.objects, grid),
        **_signal_terms(heads, targets.signal, grid),
    }
    if heads.lamps is not None and targets.lamps is not None:
        wanted, ignored = lamp_heat(targets.lamps, heads.lamps.shape[-2:])
        # few are shown at once: by their number alone a batch that has one would weigh too much
        terms["lamps"] = focal(heads.lamps, wanted, ignored, least=0.5 * len(wanted))
    if depth and weights.depth:
        terms["depth"] = torch.stack(
            [
                F.cross_entropy(
                    logits.float().flatten(0, 1), bins.flatten(0, 1).long(), ignore_index=-1
                )
                for logits, bins in zip(depth, targets.depth, strict=True)
            ]
        ).sum()
    weighted = {name: getattr(weights, name) * value for name, value in terms.items()}
    return {**weighted, "total": torch.stack(list(weighted.values())).sum()}


def focal(logits: Tensor, wanted: Tensor, ignored: Tensor, *, least: float = 1.0) -> Tensor:
    """The focal loss of heatmaps, over the number of peaks, or `least` where there are fewer.

    Args:
        logits: (B, C, H, W).
        wanted: The same shape: 1 at a peak, falling beside it.
        ignored: The same shape: what of the loss where there is no peak is not asked for, 0 to 1.
    """
    logits = logits.float()
    score = logits.sigmoid()
    peak = wanted == 1.0
    hit = (1.0 - score) ** 2 * F.logsigmoid(logits)
    miss = (1.0 - wanted) ** 4 * (1.0 - ignored) * score**2 * F.logsigmoid(-logits)
    return -torch.where(peak, hit, miss).sum() / peak.sum().clamp(min=least)


def object_classes(kinds: Tensor) -> Tensor:
    """`ObjectClass` by `ActorKind`, -1 for none."""
    table = torch.full((len(ActorKind),), -1, device=kinds.device)
    for kind, class_ in CLASS_OF_KIND.items():
        table[int(kind)] = int(class_)
    return table[kinds.long()]


def object_heat(objects: Tensor, grid: GridConfig) -> tuple[Tensor, Tensor]:
    """What the heatmaps should show.

    Args:
        objects: (B, M, 9) true rows.
        grid: Of the maps.

    Returns:
        (B, 3, X, Y) wanted, 1 in the cell of each middle that is in sight; and (B, 3, X, Y) how far
        a cell is that of somebody hidden, so that nothing is asked of it.
    """
    class_ = object_classes(objects[..., 7])
    place = _cells(objects, grid)  # (B, M, 2)
    spread = (_SPREAD * objects[..., 3:5].amin(dim=2)).clamp(_LEAST_SPREAD_M, _MOST_SPREAD_M)
    spread = spread / grid.cell_x_m
    step = torch.arange(grid.cells, device=objects.device, dtype=torch.float32)
    along, across = (
        (-((step - place[..., axis, None].floor()) ** 2) / (2.0 * spread[..., None] ** 2)).exp()
        for axis in (0, 1)
    )  # (B, M, X), (B, M, Y)
    maps = along[..., :, None] * across[..., None, :]  # (B, M, X, Y)
    seen = objects[..., 8] > 0.0
    wanted, ignored = [], []
    for number in range(len(ObjectClass)):
        of_class = class_ == number
        wanted.append((maps * (of_class & seen)[..., None, None]).amax(dim=1))
        ignored.append((maps * (of_class & ~seen)[..., None, None]).amax(dim=1))
    return torch.stack(wanted, dim=1), torch.stack(ignored, dim=1)


def _cells(rows: Tensor, grid: GridConfig) -> Tensor:
    """(..., 2) where rows are, in cells from the grid's corner."""
    x = (rows[..., 0] - grid.x_min_m) / grid.cell_x_m
    y = (rows[..., 1] - grid.y_min_m) / grid.cell_y_m
    return torch.stack([x, y], dim=-1)


def _object_terms(heads: Heads, objects: Tensor, grid: GridConfig) -> dict[str, Tensor]:
    if not objects.shape[1]:
        zero = heads.heat.sum() * 0.0
        return {"heat": zero, "boxes": zero}
    wanted, ignored = object_heat(objects, grid)
    terms = {"heat": focal(heads.heat, wanted, ignored)}
    there = (objects[..., 8] > 0.0) & (object_classes(objects[..., 7]) >= 0)  # (B, M)
    place = _cells(objects, grid)
    steps = torch.arange(-_BESIDE, _BESIDE + 1, device=objects.device)
    beside = torch.cartesian_prod(steps, steps)  # (9, 2)
    cell = place.floor().long()[:, :, None] + beside  # (B, M, 9, 2)
    inside = ((cell >= 0) & (cell < grid.cells)).all(dim=3)
    weight = (there[..., None] & inside).float()  # (B, M, 9)
    flat = (cell[..., 0] * grid.cells + cell[..., 1]).clamp(0, grid.cells**2 - 1).flatten(1)
    boxes = heads.boxes.float().flatten(2)  # (B, BOX, X*Y)
    said = boxes.gather(2, flat[:, None].expand(-1, BOX, -1)).unflatten(2, weight.shape[1:])
    offset = place[:, :, None] - cell - 0.5  # (B, M, 9, 2)
    told = torch.cat(
        [
            objects[..., 3:5].clamp(min=0.05).log(),
            objects[..., 2:3].sin(),
            objects[..., 2:3].cos(),
            objects[..., 5:7] / SPEED_MPS,
        ],
        dim=2,
    )  # (B, M, 6)
    truth = torch.cat([offset, told[:, :, None].expand(-1, -1, len(beside), -1)], dim=3)
    error = F.smooth_l1_loss(said, truth.permute(0, 3, 1, 2), reduction="none", beta=0.1)
    scale = error.new_tensor(_BOX_WEIGHTS)[:, None, None]
    terms["boxes"] = (error * scale * weight[:, None]).sum() / weight.sum().clamp(min=1.0)
    return terms


def _signal_terms(heads: Heads, signal: Tensor, grid: GridConfig) -> dict[str, Tensor]:
    half = grid.cells // 2
    there = signal[:, 7] > 0.0
    place = _cells(signal, grid) / 2.0
    inside = there & ((place >= 0.0) & (place < half)).all(dim=1)
    cell = place.floor().long().clamp(0, half - 1)
    flat = cell[:, 0] * half + cell[:, 1]
    # one behind the grid's edge is not asked for
    wanted = torch.where(there, torch.where(inside, flat, -1), half * half)
    terms = {"where": F.cross_entropy(heads.where.float(), wanted, ignore_index=-1)}
    weight = inside.float()
    count = weight.sum().clamp(min=1.0)
    line = heads.line.float().flatten(2)  # (B, 4, X/2 * Y/2)
    said, truth = [], []
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            near = cell + torch.tensor([dx, dy], device=cell.device)
            near = near.clamp(0, half - 1)
            at = near[:, 0] * half + near[:, 1]
            said.append(line.gather(2, at[:, None, None].expand(-1, 4, 1))[:, :, 0])
            heading = torch.stack([signal[:, 2].sin(), signal[:, 2].cos()], dim=1)
            truth.append(torch.cat([place - near - 0.5, heading], dim=1))
    error = F.smooth_l1_loss(torch.stack(said), torch.stack(truth), reduction="none", beta=0.1)
    terms["line"] = (error.mean(dim=0).sum(dim=1) * weight).sum() / count
    state = F.cross_entropy(heads.state.float(), signal[:, 3:7].argmax(dim=1), reduction="none")
    terms["state"] = (state * there).sum() / there.sum().clamp(min=1.0)
    return terms


def lamp_heat(lamps: Tensor, size: torch.Size) -> tuple[Tensor, Tensor]:
    """What the map of lamps should show, and where nothing is asked of it.

    Args:
        lamps: (B, K, 3) places and states.
        size: H, W of the map.

    Returns:
        (B, 4, H, W) each: 1 at lamps that govern; and 1 at others, whatever they show.
    """
    height, width = size
    rows = torch.arange(height, device=lamps.device, dtype=torch.float32)
    columns = torch.arange(width, device=lamps.device, dtype=torch.float32)
    along = (-((rows - lamps[..., 0, None].floor()) ** 2) / 0.5).exp()  # (B, K, H)
    across = (-((columns - lamps[..., 1, None].floor()) ** 2) / 0.5).exp()
    maps = along[..., :, None] * across[..., None, :]  # (B, K, H, W)
    wanted = torch.stack(
        [(maps * (lamps[..., 2] == n)[..., None, None]).amax(dim=1) for n in range(4)], dim=1
    )
    others = (maps * (lamps[..., 2] >= OTHERS)[..., None, None]).amax(dim=1)
    return wanted, others[:, None].expand_as(wanted)
