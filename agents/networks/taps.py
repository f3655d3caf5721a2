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
    taps = [_tap(model, name) for name in edits]
    hooks = [
        tap.register_forward_hook(_hook(edit))
        for tap, edit in zip(taps, edits.values(), strict=True)
    ]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()


def _tap(model: nn.Module, name: str) -> Tap:
    """A tap by its name; to look for it among all modules would take a tenth of a decision."""
    try:
        module = model.get_submodule(name)
    except AttributeError:
        module = model
    if not isinstance(module, Tap):
        check_name(name, tap_names(model), "tap")
    assert isinstance(module, Tap)
    return module


def _hook(edit: Edit) -> Callable[[nn.Module, Any, Tensor], Tensor]:
    return lambda _module, _inputs, activation: edit(activation)
