"""What a policy says of a batch of moments, and what it should have said."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from agents.driveinsight.losses import Targets
from agents.driveinsight.memory import MemoryBank
from agents.driveinsight.model import Inputs, Output, Policy
from agents.training.samples import Batch


def look(
    policy: Policy, batch: Batch, hidden: Tensor, *, mixed: bool = False
) -> tuple[Output, Targets]:
    """What a policy says at the newest moment of a batch, and the targets there.

    The moments before it are remembered, without their gradients. A sample that begins later than
    others, at its drive's start, remembers nothing of the time before.

    Args:
        policy: On any device.
        batch: Of T moments.
        hidden: (B, 10) 0 for components that are hidden.
        mixed: In mixed precision (bfloat16).
    """
    device = next(policy.parameters()).device
    hidden, bank = hidden.to(device), None

    def seen(t: int, bank: MemoryBank | None) -> tuple[Output, Inputs]:
        inputs = on_device(batch.inputs[t], device)
        inputs = dataclasses.replace(inputs, present=inputs.present * hidden)
        with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
            return policy(inputs, bank), inputs

    for t in range(len(batch.inputs) - 1):
        with torch.no_grad():
            output, inputs = seen(t, bank)
        assert output.remembered is not None, "only a memory needs a past"
        assert inputs.pose is not None
        assert policy.perception is not None
        bank = bank or policy.perception.empty_bank(len(hidden), like=output.remembered)
        bank = bank.remember(output.remembered, inputs.pose)
        begun = batch.begun[t].bool().to(device)
        valid = torch.cat([bank.valid[:, :1] & begun[:, None], bank.valid[:, 1:]], dim=1)
        bank = dataclasses.replace(bank, valid=valid)
    return seen(len(batch.inputs) - 1, bank)[0], on_device(batch.targets, device)


def on_device(values: Any, device: torch.device) -> Any:
    """A bundle of tensors, of mappings or tuples of them, or of other bundles, on a device."""
    if isinstance(values, Tensor):
        return values.to(device, non_blocking=True)
    if isinstance(values, Mapping):
        return {name: on_device(item, device) for name, item in values.items()}
    if isinstance(values, tuple):
        return tuple(on_device(item, device) for item in values)
    if values is None:
        return None
    fields = dataclasses.fields(values)
    return type(values)(
        **{field.name: on_device(getattr(values, field.name), device) for field in fields}
    )
