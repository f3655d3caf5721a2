"""Training by several processes, each with its share of every batch; `torchrun` starts them.

    torchrun --nproc-per-node 2 -m leaderboard train --config driveinsight

A step is that of one process with the whole batch: each loss term is a mean over what its targets
count, so shares are weighted by their counts before gradients are summed. (The mean of the shares'
means, as `DistributedDataParallel` takes it, would be another one.) On GPUs batch norms see the
whole batch too; on CPUs, where torch cannot do that, each sees its share.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
import torch.distributed as dist
from torch import Tensor, nn

PATIENCE = timedelta(hours=6)  # while the first process drives a check, the others wait


@dataclass(frozen=True, kw_only=True)
class Team:
    """The processes that train together; one alone is a team too.

    Attributes:
        rank: Which of them this is; the first (0) writes files and talks.
        size: How many there are.
        here: How many of them are on this machine.
    """

    rank: int = 0
    size: int = 1
    here: int = 1

    @property
    def first(self) -> bool:
        """Whether this process writes and talks."""
        return self.rank == 0

    def share(self, batch: int) -> slice:
        """This process's part of a batch's rows."""
        each = batch // self.size
        return slice(self.rank * each, (self.rank + 1) * each)

    def begin(self, policy: nn.Module) -> None:
        """Makes a policy ready to be trained by the team: all have the first one's weights."""
        if self.size == 1:
            return
        if next(policy.parameters()).is_cuda:
            nn.SyncBatchNorm.convert_sync_batchnorm(policy)  # in place
        for value in policy.state_dict().values():
            dist.broadcast(value, 0)

    def share_buffers(self, policy: nn.Module) -> None:
        """Gives all the first one's running means: those that are kept."""
        if self.size > 1:
            for value in policy.buffers():
                dist.broadcast(value, 0)

    def weighted(
        self, terms: Mapping[str, Tensor], counts: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Loss terms of a share, such that their sums over the team are those of the whole batch.

        Args:
            terms: By name, each the mean over a share, and `total`, their sum.
            counts: By name, what each is a mean over.
        """
        if self.size == 1:
            return dict(terms)
        names = [name for name in terms if name != "total"]
        ours = torch.stack([counts[name].float() for name in names])
        parts = ours / self._sum(ours).clamp(min=1.0)
        scaled = {name: terms[name] * part for name, part in zip(names, parts, strict=True)}
        return {**scaled, "total": torch.stack(list(scaled.values())).sum()}

    def summed(self, terms: Mapping[str, Tensor]) -> dict[str, float]:
        """Each number's sum over the team."""
        values = torch.stack([value.detach().float() for value in terms.values()])
        return dict(zip(terms, self._sum(values).tolist(), strict=True))

    def sum_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Makes every gradient its sum over the team; one that a share has not is zero there."""
        if self.size == 1:
            return
        every = list(parameters)
        gradients = [torch.zeros_like(p) if p.grad is None else p.grad for p in every]
        flat = torch.cat([gradient.flatten() for gradient in gradients])
        dist.all_reduce(flat)
        parts = flat.split([p.numel() for p in every])
        for parameter, part in zip(every, parts, strict=True):
            parameter.grad = part.view_as(parameter)

    def any(self, yes: bool) -> bool:
        """Whether any of them says yes."""
        if self.size == 1:
            return yes
        answer = torch.tensor([float(yes)], device=self._device())
        return bool(self._sum(answer) > 0.0)

    def _sum(self, values: Tensor) -> Tensor:
        if self.size > 1:
            values = values.clone()
            dist.all_reduce(values)
        return values

    def _device(self) -> str:
        return "cuda" if dist.get_backend() == "nccl" else "cpu"


ALONE = Team()


@contextmanager
def joined_team(device: str) -> Iterator[tuple[Team, str]]:
    """The team that `torchrun` started this process in, and this one's device.

    Args:
        device: `cpu` or `cuda`.
    """
    size = int(os.environ.get("WORLD_SIZE", "1"))  # that is how torchrun tells its processes
    if size == 1:
        yield ALONE, device
        return
    if device == "cuda":
        device = f"cuda:{os.environ['LOCAL_RANK']}"
        torch.cuda.set_device(device)
    dist.init_process_group("nccl" if device != "cpu" else "gloo", timeout=PATIENCE)
    try:
        here = int(os.environ["LOCAL_WORLD_SIZE"])
        yield Team(rank=dist.get_rank(), size=size, here=here), device
    finally:
        dist.destroy_process_group()
