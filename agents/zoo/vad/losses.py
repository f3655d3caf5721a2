"""What `vad` learns: others and their ways, lines, the plan, and what the plan must not do.

Constraints are set on the plan by what the network itself says is there.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.driveinsight.rows import METRES, SPEED
from agents.zoo.errors import waypoint_error
from agents.zoo.eyes import BEV
from agents.zoo.system import Labels, Output
from di_envs.town.map_chunks import MapKind

# As published, relative to the plan's 1
PRESENCE, BOXES, WAYS, MODE, KINDS, LINES = 0.8, 0.1, 0.2, 0.2, 0.8, 0.4
COLLISION, BOUNDARY, DIRECTION = 1.0, 1.0, 0.5
AHEAD_M, ASIDE_M = 3.0, 1.5  # nearer than that others are not to come
EDGE_M = 1.0  # nor a line that must not be crossed
LANE_M, MOVING_M = 2.0, 0.5  # whose lane a step follows, and how long a step has a direction
SURE = 0.5  # of what the network says is there
_FAR = 1e4


def vad_losses(output: Output, labels: Labels) -> dict[str, Tensor]:
    """The terms, weighted."""
    said = {name: value.float() for name, value in (output.said or {}).items()}
    plan = output.waypoints
    return {
        "waypoints": waypoint_error(output, labels),
        **_agents(said, labels),
        **_lines(said, labels["map"].float()),
        "collision": COLLISION * collision(plan, said),
        "boundary": BOUNDARY * boundary(plan, said),
        "direction": DIRECTION * direction(plan, said),
    }


def matched(cost: Tensor, there: Tensor) -> tuple[Tensor, Tensor]:
    """Gives each thing that is there a query of its own, the first things first.

    Args:
        cost: (B, Q, N) of a query for a thing.
        there: (B, N) whether there is such a thing.

    Returns:
        (B, N) which query, and whether it got one.
    """
    used, chosen, got = cost.new_zeros(cost.shape[:2]), list[Tensor](), list[Tensor]()
    for n in range(cost.shape[2]):
        query = (cost[:, :, n].detach() + _FAR * used).argmin(dim=1)  # (B,)
        free = there[:, n] & (used.gather(1, query[:, None])[:, 0] == 0.0)
        used = used.scatter_add(1, query[:, None], free.float()[:, None])
        chosen.append(query)
        got.append(free)
    return torch.stack(chosen, dim=1), torch.stack(got, dim=1)


def _agents(said: dict[str, Tensor], labels: Labels) -> dict[str, Tensor]:
    """Others: presence, box, and the way of the mode that comes nearest."""
    objects, motion = labels["objects"].float(), labels["motion"].float()
    there = objects[..., 8] > 0.0
    truth = torch.cat(
        [
            objects[..., :2],
            objects[..., 3:5].clamp(min=0.1).log(),
            objects[..., 2:3].sin(),
            objects[..., 2:3].cos(),
            objects[..., 5:7] / SPEED,
        ],
        dim=2,
    )
    away = torch.cdist(said["boxes"][..., :2], truth[..., :2], p=1.0) / METRES
    query, got = matched(away - said["presence"].sigmoid()[:, :, None], there)
    found = torch.zeros_like(said["presence"]).scatter_add(1, query, got.float())
    scale = truth.new_tensor([1.0 / METRES] * 2 + [1.0] * 6)
    boxes = _taken(said["boxes"], query)
    error = ((boxes - truth).abs() * scale).sum(dim=2)
    ways = _taken(said["ways"], query)  # (B, N, modes, T, 2)
    known = motion[..., 2] * got[..., None]  # (B, N, T)
    off = (ways - motion[:, :, None, :, :2]).abs().sum(dim=4) * known[:, :, None]
    off = off.sum(dim=3) / known.sum(dim=2).clamp(min=1.0)[..., None]  # (B, N, modes)
    best = off.argmin(dim=2)
    which = F.cross_entropy(
        _taken(said["mode"], query).flatten(0, 1), best.flatten(), reduction="none"
    )
    moves = got & (known.sum(dim=2) > 0.0)
    return {
        "presence": PRESENCE * _focal(said["presence"], found),
        "boxes": BOXES * _mean(error, got),
        "ways": WAYS * _mean(off.amin(dim=2), moves),
        "mode": MODE * _mean(which.view_as(best), moves),
    }


def _lines(said: dict[str, Tensor], lines: Tensor) -> dict[str, Tensor]:
    """Lines of the road, their points in the order of their lane."""
    truth = lines[..., :2]  # (B, M, POINTS, 2)
    middle = truth.mean(dim=2)
    there = lines[..., 3].amin(dim=2) > 0.0
    there &= (middle[..., 0] >= BEV.x_min_m) & (middle[..., 0] < BEV.x_max_m)
    there &= (middle[..., 1] >= BEV.y_min_m) & (middle[..., 1] < BEV.y_max_m)
    kind = lines[..., 2].amax(dim=2).long()  # (B, M)
    off = torch.cdist(said["points"].flatten(2), truth.flatten(2), p=1.0) / lines.shape[2]
    chance = said["kinds"].softmax(dim=2)
    likely = chance.gather(2, kind[:, None].expand(-1, chance.shape[1], -1))
    query, got = matched(off / METRES - likely, there)
    wanted = torch.zeros_like(said["kinds"][..., 0]).long()
    wanted = wanted.scatter_add(1, query, kind * got)
    wrong = F.cross_entropy(said["kinds"].flatten(0, 1), wanted.flatten())
    return {
        "kinds": KINDS * wrong,
        "lines": LINES * _mean(off.gather(1, query[:, None])[:, 0], got) / METRES,
    }


def collision(plan: Tensor, said: dict[str, Tensor]) -> Tensor:
    """How far the plan comes too near to where somebody most likely will be then [m]."""
    best = said["mode"].argmax(dim=2)[:, :, None, None, None]
    ways = said["ways"].detach().gather(2, best.expand(-1, -1, 1, *said["ways"].shape[3:]))[:, :, 0]
    away = (ways - plan[:, None]).abs()  # (B, A, T, 2)
    short = F.relu(AHEAD_M - away[..., 0]), F.relu(ASIDE_M - away[..., 1])
    inside = (short[0] > 0.0) & (short[1] > 0.0)
    inside &= (said["presence"].sigmoid() > SURE)[:, :, None]
    return ((short[0] + short[1]) * inside).amax(dim=1).mean()


def boundary(plan: Tensor, said: dict[str, Tensor]) -> Tensor:
    """How far the plan comes too near to a line that must not be crossed [m]."""
    away, _ = _nearest(plan, said, MapKind.SOLID_LINE)
    return F.relu(EDGE_M - away).mean()


def direction(plan: Tensor, said: dict[str, Tensor]) -> Tensor:
    """How far steps are turned from the lane that they are on [rad]."""
    away, points = _nearest(plan, said, MapKind.LANE_CENTRE)
    steps = torch.diff(plan, dim=1, prepend=torch.zeros_like(plan[:, :1]))
    along = points[1] - points[0]  # (B, T, 2)
    on_lane = (away < LANE_M) & (steps.detach().norm(dim=2) > MOVING_M)
    across = steps[..., 1] * along[..., 0] - steps[..., 0] * along[..., 1]
    inner = (steps * along).sum(dim=2)
    turned = torch.where(on_lane, across, 0.0), torch.where(on_lane, inner, 1.0)
    return torch.atan2(*turned).abs().mean()


def _nearest(
    plan: Tensor, said: dict[str, Tensor], kind: MapKind
) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    """(B, T) how far the nearest line of a kind is [m], and the two points that it runs between."""
    sure = said["kinds"].detach().softmax(dim=2)[..., kind] > SURE  # (B, L)
    points = said["points"].detach()
    first, second = points[:, :, :-1].flatten(1, 2), points[:, :, 1:].flatten(1, 2)
    middle = 0.5 * (first + second)
    away = (plan[:, :, None] - middle[:, None]).square().sum(dim=3).clamp(min=1e-6).sqrt()
    unsure = ~sure[:, :, None].expand(-1, -1, points.shape[2] - 1).flatten(1)
    away, which = (away + _FAR * unsure[:, None]).min(dim=2)  # (B, T)
    index = which[..., None].expand(-1, -1, 2)
    return away, (first.gather(1, index), second.gather(1, index))


def _taken(values: Tensor, query: Tensor) -> Tensor:
    """(B, N, ...) of (B, Q, ...): what the query that each thing got says."""
    sample = torch.arange(len(values), device=values.device)[:, None]
    return values[sample, query]


def _focal(logits: Tensor, truth: Tensor) -> Tensor:
    """Focal loss, over as many as are there; Lin et al., ICCV 2017."""
    loss = F.binary_cross_entropy_with_logits(logits, truth, reduction="none")
    missed = (truth - logits.sigmoid()).square()
    weight = 0.25 * truth + 0.75 * (1.0 - truth)
    return (weight * missed * loss).sum() / truth.sum().clamp(min=1.0)


def _mean(values: Tensor, there: Tensor) -> Tensor:
    return (values * there).sum() / there.sum().clamp(min=1.0)
