"""Marks on a network's activations: what can be looked at, differentiated and edited, by name.

A `Tap` is an identity; its dotted path in the model, such as `planner.attention.0`, is its name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from torch import Tensor, nn

from di_envs.config import check_name

Edit = Callable[[Tensor], Tensor]


class Tap(nn.Module):
    """Hands an activation on unchanged, unless somebody edits it."""

    def forward(self, activation: Tensor) -> Tensor:
        return activation


def tap_names(model: nn.Module) -> tuple[str, ...]:
    """The names of a model's taps, in the order in which they were made."""
    return tuple(name for name, module in model.named_modules() if isinstance(module, Tap))


@contextmanager
def watching(model: nn.Module, *names: str) -> Iterator[dict[str, list[Tensor]]]:
    """Collects what passes the named taps; all of them when none is named.

    Yields:
        Tap name to its activations, in the order of the calls; still part of the graph.

    Raises:
        ValueError: If a name is unknown; suggests the nearest.
    """
    seen: dict[str, list[Tensor]] = {name: [] for name in names or tap_names(model)}

    def watch(name: str) -> Edit:
        def note(activation: Tensor) -> Tensor:
            seen[name].append(activation)
            return activation

        return note

    with editing(model, {name: watch(name) for name in seen}):
        yield seen


@contextmanager
def editing(model: nn.Module, edits: Mapping[str, Edit]) -> Iterator[None]:
    """Puts functions in the way of the named taps; takes them out again whatever happens.

    Raises:
        ValueError: If a name is unknown; suggests the nearest.
    """
    if not edits:  # a tenth of a decision would go into looking for names
        yield
        return
    modules = dict(model.named_modules())
    known = tap_names(model)
    for name in edits:
        check_name(name, known, "tap")
    hooks = []
    for name, edit in edits.items():
        hooks.append(modules[name].register_forward_hook(_hook(edit)))
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()


def _hook(edit: Edit) -> Callable[[nn.Module, Any, Tensor], Tensor]:
    return lambda _module, _inputs, activation: edit(activation)
