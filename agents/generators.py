"""Generators of random numbers that all code of a process shares, begun anew for every route.

Our own agents draw from keyed randomness and need none of this. Code of others draws from `random`,
NumPy and torch, whose generators go on from route to route: so a drive would depend on what was
driven before it, and two workers would not agree with one.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


@dataclass(frozen=True)
class _Generator:
    """A module with a generator, and its functions that seed it, read its state and set it."""

    module: str
    seed: str
    state: str
    put_back: str


_GENERATORS = (
    _Generator("random", "seed", "getstate", "setstate"),
    _Generator("numpy.random", "seed", "get_state", "set_state"),
    _Generator("torch", "manual_seed", "get_rng_state", "set_rng_state"),
)


class Generators:
    """The generators of this process, while they are an agent's."""

    def __init__(self) -> None:
        self._seed = 0

    def begin(self, seed: int) -> None:
        """Begins them anew; one whose module is loaded later begins so, too."""
        self._seed = seed % 2**32
        for generator, module in _loaded():
            self._begin(generator, module)

    def _begin(self, generator: _Generator, module: ModuleType) -> None:
        getattr(module, generator.seed)(self._seed)

    def loaded(self, module: ModuleType) -> None:
        """Told of a module of generators that has just been loaded."""
        for generator in _GENERATORS:
            if generator.module == module.__name__:
                self._begin(generator, module)


@contextmanager
def generators() -> Iterator[Generators]:
    """Within, the generators are an agent's; afterwards they are as their caller had them."""
    before = [(module, g.put_back, getattr(module, g.state)()) for g, module in _loaded()]
    ours = Generators()
    late = _Late([g.module for g in _GENERATORS if g.module not in sys.modules], ours.loaded)
    sys.meta_path.insert(0, late)
    try:
        yield ours
    finally:
        sys.meta_path.remove(late)
        for module, put_back, state in before:
            getattr(module, put_back)(state)


def _loaded() -> list[tuple[_Generator, ModuleType]]:
    found = ((generator, sys.modules.get(generator.module)) for generator in _GENERATORS)
    return [(g, module) for g, module in found if module is not None and hasattr(module, g.seed)]


class _Late(MetaPathFinder):
    """Tells of modules as soon as they are loaded."""

    def __init__(self, names: Sequence[str], tell: Callable[[ModuleType], None]) -> None:
        self._names, self._tell = set(names), tell

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """The spec that the other finders have of it, with a loader that tells."""
        if name not in self._names:
            return None
        self._names.remove(name)  # the others are asked through the same door
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _Telling(spec.loader, self._tell)
        return spec


class _Telling(Loader):
    """A loader that tells of its module once it is loaded."""

    def __init__(self, loader: Loader, tell: Callable[[ModuleType], None]) -> None:
        self._loader, self._tell = loader, tell

    def __getattr__(self, name: str) -> Any:
        """All else is the loader's."""
        return getattr(self._loader, name)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """As the loader does."""
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        """As the loader does; then tells."""
        self._loader.exec_module(module)
        self._tell(module)
