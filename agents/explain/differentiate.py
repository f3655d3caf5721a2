"""One decision once more, with the gradients of its waypoints; everything is left as it was found.

The gradients are taken with `torch.autograd.grad`, which writes into no `.grad`; hooks are removed
and modes put back whatever happens. Frozen weights (`requires_grad=False`) are no obstacle: where
no graph reaches a tap, one is begun there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from agents.base import Agent, Observation
from agents.explain.protocol import Anatomy, Explainable, NotExplainableError, explainable
from agents.one_thread import one_thread
from di_envs.config import check_name

DIRECTIONS = ("x", "y")  # of waypoints: ahead and right [m]


@dataclass(frozen=True, kw_only=True)
class Differentiated:
    """A decision, what passed the taps, and how the waypoints change with it.

    Attributes:
        waypoints: (T, 2) x ahead, y right [m].
        activations: Tap to what passed it.
        gradients: Tap to (2, ...) the gradient of p^x and of p^y with respect to what passed it,
            where p^c is the mean of the waypoints' coordinate c [m]. Zeros where p does not depend
            on it.
    """

    waypoints: Tensor
    activations: Mapping[str, Tensor]
    gradients: Mapping[str, Tensor]


def differentiate(
    policy: Explainable,
    observation: Observation,
    memory: Any,
    *,
    taps: Sequence[str],
    watched: Sequence[str] = (),
) -> Differentiated:
    """Lets a policy decide again, and differentiates its waypoints.

    Args:
        policy: The policy.
        observation: As `act` was given it.
        memory: As `act` was given it.
        taps: With respect to what passes these.
        watched: Taps whose activations are wanted, and no gradients.

    Raises:
        NotExplainableError: If there is no such tap, or what passes it cannot be differentiated.
    """
    taps = tuple(dict.fromkeys(taps))
    names = tuple(dict.fromkeys((*taps, *watched)))
    with (
        one_thread(),
        torch.inference_mode(False),
        torch.enable_grad(),
        evaluating(policy.model),
        recording(policy.model, names) as seen,
    ):
        waypoints = policy.waypoints(observation, memory)
        for name in names:
            if name not in seen:
                raise NotExplainableError(f"nothing passed tap '{name}' while the policy decided")
        _check(waypoints)
        gradients = _gradients(waypoints, [seen[tap] for tap in taps])
    return Differentiated(
        waypoints=waypoints.detach(),
        activations={name: seen[name].detach() for name in names},
        gradients=dict(zip(taps, gradients, strict=True)),
    )


def _gradients(waypoints: Tensor, activations: Sequence[Tensor]) -> list[Tensor]:
    """(2, ...) for each activation."""
    if not activations:
        return []
    sums = [waypoints[:, c].mean() for c in range(len(DIRECTIONS))]
    rows = [
        torch.autograd.grad(
            p, activations, retain_graph=True, allow_unused=True, materialize_grads=True
        )
        for p in sums
    ]
    return [torch.stack(pair) for pair in zip(*rows, strict=True)]


def _check(waypoints: Tensor) -> None:
    if waypoints.ndim != 2 or waypoints.shape[1] != len(DIRECTIONS):
        raise NotExplainableError(
            f"waypoints must be (T, 2) x ahead, y right, not {tuple(waypoints.shape)}"
        )
    if not waypoints.requires_grad:
        raise NotExplainableError(
            "the waypoints are not part of torch's graph: compute them without no_grad, "
            "inference_mode, detach or numpy on the way, and name taps that lie on it"
        )


def differentiate_agent(
    agent: Agent[Any],
    observation: Observation,
    memory: Any,
    *taps_of: Callable[[Anatomy], Sequence[str]],
) -> tuple[Anatomy, Differentiated]:
    """The same for an agent, at taps that its policy's anatomy names; attention is watched.

    Args:
        agent: With a method `explainable()`, see `protocol`.
        observation: As `act` was given it.
        memory: As `act` was given it; neither is changed.
        taps_of: What names taps of an anatomy, such as `responses.group_taps`.

    Raises:
        NotExplainableError: If its policy cannot be looked into.
    """
    policy = explainable(agent)
    anatomy = policy.anatomy
    taps = [tap for named in taps_of for tap in named(anatomy)]
    return anatomy, differentiate(policy, observation, memory, taps=taps, watched=anatomy.attention)


@contextmanager
def evaluating(model: nn.Module) -> Iterator[None]:
    """The model in evaluation mode; each of its modules gets its own mode back."""
    training = [module for module in model.modules() if module.training]
    model.eval()
    try:
        yield
    finally:
        for module in training:
            module.training = True


@contextmanager
def recording(model: nn.Module, names: Sequence[str]) -> Iterator[dict[str, Tensor]]:
    """Keeps what passes the named taps, as part of the graph.

    Yields:
        Tap to what passed it, once the model has run.

    Raises:
        NotExplainableError: If a tap is unknown, is passed twice, or by what is no tensor.
    """
    modules = dict(model.named_modules())
    for name in names:
        try:
            check_name(name, [known for known in modules if known], "tap of the model")
        except ValueError as error:
            raise NotExplainableError(str(error)) from error
    seen: dict[str, Tensor] = {}
    hooks = []
    try:
        for name in names:
            hooks.append(modules[name].register_forward_hook(_keep(name, seen)))
        yield seen
    finally:
        for hook in hooks:
            hook.remove()


def _keep(name: str, seen: dict[str, Tensor]) -> Callable[[nn.Module, Any, Any], Tensor]:
    def hook(_module: nn.Module, _inputs: Any, output: Any) -> Tensor:
        if not isinstance(output, Tensor) or not output.is_floating_point():
            kind = output.dtype if isinstance(output, Tensor) else type(output).__name__
            raise NotExplainableError(f"tap '{name}' hands on {kind}, not a tensor of real numbers")
        if name in seen:
            raise NotExplainableError(
                f"tap '{name}' was passed twice in one decision: give each place a tap of its own"
            )
        seen[name] = output if output.requires_grad else output.detach().requires_grad_()
        return seen[name].clone()  # what comes next may change it in place

    return hook
