"""What a small policy reads of the prompt: the road ahead, and who and what lies on it.

Stable-Baselines3's own extractor for `Dict` observations strings all numbers together as they are,
metres and radians and empty rows alike, and learns little from that. This one scales them, tells
each obstacle, light and stop sign how far along the route and how far off it stands, reads all
rows of a table with the same small network, and keeps the largest of what they say. The order of
the rows then does not matter, and empty ones say nothing (Qi et al., PointNet, CVPR 2017).
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

ROUTE_SAMPLES = (0, 2, 4, 6, 8, 11, 14, 18, 23, 29, 37, 47)  # of the 50 points at 1 m
OBSTACLES_READ = 16  # the nearest
OFF_ROUTE_M = 20.0  # what is further off than this is just far away
KEYS = (
    "command",
    "target_point",
    "routing",
    "obstacles",
    "traffic_lights",
    "stop_signs",
    "speed",
    "speed_history",
)  # what it reads: `map` and `prompt_present` are not among them


class PromptFeatures(BaseFeaturesExtractor):
    """Turns the prompt, (B, …) tables in the ego frame, into (B, features) for a policy.

    Use it as `policy_kwargs={"features_extractor_class": PromptFeatures}` with `MultiInputPolicy`.
    """

    def __init__(self, observation_space: spaces.Dict, width: int = 32) -> None:
        """Makes the small networks.

        Args:
            observation_space: A `Dict` with the entries `KEYS`, others are not read.
            width: How many numbers each table is summed up in.
        """
        missing = [key for key in KEYS if key not in observation_space.spaces]
        if missing:
            raise ValueError(
                f"PromptFeatures reads {', '.join(KEYS)}; {', '.join(missing)} missing."
            )
        straight = 7 + 4 + 5 + 4 * len(ROUTE_SAMPLES)
        super().__init__(observation_space, features_dim=straight + 3 * width)
        self.obstacles = _rows(6 + 4 + 1, width)
        self.lights = _rows(6 + 3, width)
        self.signs = _rows(6, width)

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """(B, features)."""
        routing = observations["routing"]  # (B, 50, 4)
        target = observations["target_point"]
        x, y, yaw = target.unbind(-1)
        parts = [
            observations["command"].flatten(1),  # (B, 7)
            torch.stack([x / 50.0, y / 50.0, yaw.cos(), yaw.sin()], -1),
            observations["speed"] / 10.0,
            observations["speed_history"] / 10.0,
            _route(routing).flatten(1),  # (B, 4 * samples)
            self._obstacles(observations["obstacles"][:, :OBSTACLES_READ], routing),
            self._lights(observations["traffic_lights"], routing),
            self._signs(observations["stop_signs"], routing),
        ]
        return torch.cat(parts, dim=1)

    def _obstacles(self, table: Tensor, routing: Tensor) -> Tensor:
        size_and_speed = table[..., 3:7] / table.new_tensor([5.0, 5.0, 10.0, 10.0])
        walker = (table[..., 7:8] == 7.0).float()
        rows = torch.cat([_place(table, routing), size_and_speed, walker], dim=-1)
        return _pooled(self.obstacles(rows), table[..., 8:9])

    def _lights(self, table: Tensor, routing: Tensor) -> Tensor:
        states = [(table[..., 3:4] == state).float() for state in (1.0, 2.0, 3.0)]
        rows = torch.cat([_place(table, routing), *states], dim=-1)
        return _pooled(self.lights(rows), table[..., 4:5])

    def _signs(self, table: Tensor, routing: Tensor) -> Tensor:
        return _pooled(self.signs(_place(table, routing)), table[..., 3:4])


def _rows(inputs: int, width: int) -> nn.Module:
    return nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())


def _pooled(rows: Tensor, valid: Tensor) -> Tensor:
    """(B, K, F) and (B, K, 1) to (B, F): the largest over the valid rows, 0 where there is none."""
    pooled: Any = (rows * valid).amax(dim=1)
    return pooled


def _route(routing: Tensor) -> Tensor:
    """(B, 50, 4) to (B, samples, 4): x, y, sine of the yaw, valid."""
    x, y, yaw, valid = routing[:, ROUTE_SAMPLES].unbind(-1)
    return torch.stack([x / 30.0, y / 10.0, yaw.sin(), valid], -1)


def _place(table: Tensor, routing: Tensor) -> Tensor:
    """(B, K, 6): x, y, direction, and where on the route and how far off it a row's place is.

    Args:
        table: (B, K, ≥3) x, y [m] and yaw first, in the ego frame.
        routing: (B, 50, 4) the route's next points.
    """
    x, y, yaw = table[..., 0], table[..., 1], table[..., 2]
    off_m = torch.hypot(
        x[..., None] - routing[:, None, :, 0], y[..., None] - routing[:, None, :, 1]
    )  # (B, K, 50)
    off_m = off_m + 1e3 * (1.0 - routing[:, None, :, 3])  # points that are not there
    nearest_m, point = off_m.min(dim=-1)
    nearest = nearest_m.clamp(max=OFF_ROUTE_M) / OFF_ROUTE_M
    along = point.float() / routing.shape[1]
    return torch.stack([x / 40.0, y / 40.0, yaw.cos(), yaw.sin(), along, nearest], -1)
