"""The ground to the masks that a teacher reads, hardened, and what they are learnt by."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.networks.taps import Tap
from agents.networks.unet import UNet
from agents.zoo.raster import GRID, ROUTE_HALF_M, RasterChannel

SAID = tuple(
    channel
    for channel in RasterChannel
    if channel not in (RasterChannel.ROUTE, RasterChannel.AHEAD, RasterChannel.RIGHT)
)
VELOCITIES = (RasterChannel.AHEAD, RasterChannel.RIGHT)
_MOVING = (RasterChannel.VEHICLE, RasterChannel.WALKER)
SURE = 0.5  # from which on a cell of a mask is 1
# How much more what is there weighs than what is not, by channel of `SAID`
WEIGHTS = (1.0, 5.0, 5.0, 20.0, 20.0, 20.0, 20.0)
_SIDE_M = 1e3  # of a point that is not there


class MaskHead(nn.Module):
    """The ground to logits of masks, and to velocities."""

    def __init__(self, channels: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.body = UNet(channels, widths)
        self.out = nn.Conv2d(widths[0], len(SAID) + len(VELOCITIES), 1)
        self.raster = Tap()

    def forward(self, bev: Tensor, route: Tensor) -> tuple[Tensor, Tensor]:
        """Says, and makes what the teacher reads.

        Args:
            bev: (B, C, X, Y) on cells of 1 m.
            route: (B, X, Y) 0 or 1 on the teacher's grid: it is told, not seen.

        Returns:
            (B, SAID + VELOCITIES, X, Y) on the teacher's grid; and the view (B, RasterChannel, X,
            Y), masks of 0 and 1 whose gradient is that of their probabilities.
        """
        said = F.interpolate(
            self.out(self.body(bev)), route.shape[1:], mode="bilinear", align_corners=False
        )
        logits, velocities = said.split([len(SAID), len(VELOCITIES)], dim=1)
        chance = logits.sigmoid()
        hard = (chance > SURE).to(chance.dtype) + chance - chance.detach()
        masks = dict(zip(SAID, hard.unbind(1), strict=True)) | {RasterChannel.ROUTE: route}
        somebody = torch.stack([masks[channel].detach() for channel in _MOVING]).amax(dim=0)
        for channel, velocity in zip(VELOCITIES, velocities.unbind(1), strict=True):
            masks[channel] = velocity * somebody
        return said, self.raster(torch.stack([masks[channel] for channel in RasterChannel], dim=1))


def drawn_route(routing: Tensor) -> Tensor:
    """(B, X, Y) 0 or 1: cells near the points of a route, (B, R, 4) as the prompt has them."""
    step = (torch.arange(GRID.cells, device=routing.device) + 0.5) * GRID.cell_x_m
    ahead, right = step + GRID.x_min_m, step + GRID.y_min_m
    away = torch.where(routing[..., 3:] > 0.0, routing[..., :2], _SIDE_M)  # (B, R, 2)
    along = (ahead - away[..., :1]).square()[:, :, :, None]  # (B, R, X, 1)
    across = (right - away[..., 1:]).square()[:, :, None]  # (B, R, 1, Y)
    return ((along + across).amin(dim=1) <= ROUTE_HALF_M**2).to(routing.dtype)


def mask_losses(said: Tensor, truth: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Cross-entropy and dice of masks, and L1 of velocities.

    Args:
        said: (B, SAID + VELOCITIES, X, Y) as `MaskHead` says it.
        truth: (B, RasterChannel, X, Y).
    """
    logits, velocities = said.float().split([len(SAID), len(VELOCITIES)], dim=1)
    masks = truth[:, list(SAID)]
    weights = logits.new_tensor(WEIGHTS)[:, None, None]
    entropy = F.binary_cross_entropy_with_logits(logits, masks, pos_weight=weights)
    chance = logits.sigmoid()
    both = (chance * masks).sum(dim=(0, 2, 3))
    dice = 1.0 - (2.0 * both + 1.0) / (chance + masks).sum(dim=(0, 2, 3)).add(1.0)
    somebody = truth[:, list(_MOVING)].amax(dim=1, keepdim=True)
    off = ((velocities - truth[:, list(VELOCITIES)]).abs() * somebody).sum()
    return entropy, dice.mean(), off / somebody.sum().clamp(min=1.0)
