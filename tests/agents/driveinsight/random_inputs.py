"""Inputs and targets of the right shapes with random content, for networks that learnt nothing."""

from __future__ import annotations

import torch
from torch import Tensor

from agents.driveinsight.camera import image_groups
from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.losses import Targets
from agents.driveinsight.model import Inputs, Output, Policy
from agents.driveinsight.semantics import BevClass
from di_envs.prompt import LIGHTS, MAP_POLYLINES, OBSTACLES, ROUTING_POINTS, STOP_SIGNS
from di_envs.sensors.camera.config import rig_of
from di_envs.town.map_chunks import POINTS


def random_inputs(config: PolicyConfig, batch: int = 1, seed: int = 0, rays: int = 600) -> Inputs:
    """Inputs for a policy of that configuration."""
    draw = torch.Generator().manual_seed(seed)

    def normal(*shape: int) -> Tensor:
        return torch.randn(batch, *shape, generator=draw)

    def table(rows: int, columns: int) -> Tensor:
        """Rows with a valid column, about half of them valid."""
        content = normal(rows, columns) * 10.0
        content[..., -1] = (content[..., -1] > 0.0).float()
        return content

    prompt = {
        "command": torch.randint(0, 7, (batch,), generator=draw),
        "target_point": normal(3),
        "routing": table(ROUTING_POINTS, 4),
        "map": table(MAP_POLYLINES * POINTS, 4).unflatten(1, (MAP_POLYLINES, POINTS)),
        "obstacles": table(OBSTACLES, 9),
        "traffic_lights": table(LIGHTS, 5),
        "stop_signs": table(STOP_SIGNS, 4),
        "speed": normal(1).abs() * 5.0,
        "speed_history": normal(4).abs() * 5.0,
    }
    images: tuple[Tensor, ...] = ()
    points = None
    if config.camera is not None:
        groups = image_groups(rig_of(config.camera.rig))
        sizes = [(batch, len(group), 3, group[0].height, group[0].width) for group in groups]
        images = tuple(
            torch.randint(0, 256, size, dtype=torch.uint8, generator=draw) for size in sizes
        )
    if config.lidar is not None:
        spread, middle = torch.tensor([8.0, 8.0, 1.0, 0.2]), torch.tensor([11.0, 0.0, 1.0, 0.5])
        points = normal(rays, 4) * spread + middle
    return Inputs(
        prompt=prompt,
        present=torch.ones(batch, len(TOKENS)),
        images=images,
        points=points,
        pose=normal(3),
    )


def awake(policy: Policy) -> Policy:
    """A policy whose layers that begin at zero are drawn as the others are."""
    if policy.bev is not None:
        torch.nn.init.normal_(policy.bev.way.out.weight, std=0.1)
    return policy


def random_targets(output: Output, seed: int = 0) -> Targets:
    """Targets for what a policy said."""
    draw = torch.Generator().manual_seed(seed)
    batch = len(output.waypoints)
    steps = torch.rand(batch, 8, 2, generator=draw) * torch.tensor([4.0, 0.5])
    cells = 48 if output.heads is None else output.heads.semantics.shape[-1]
    semantics = torch.randint(0, len(BevClass), (batch, cells, cells), generator=draw)
    return Targets(
        waypoints=steps.cumsum(1),
        valid=torch.ones(batch, 8),
        semantics=semantics if output.heads is not None else None,
    )


def sample(inputs: Inputs, index: int) -> Inputs:
    """One of a batch, as a batch of one."""

    def one(value: Tensor | None) -> Tensor | None:
        return None if value is None else value[index : index + 1]

    return Inputs(
        prompt={name: value[index : index + 1] for name, value in inputs.prompt.items()},
        present=inputs.present[index : index + 1],
        images=tuple(group[index : index + 1] for group in inputs.images),
        points=one(inputs.points),
        pose=one(inputs.pose),
    )
