"""Environments copied and pickled: made anew as they were made, then put to where they are.

A world holds machine code and views into one block of memory, which no copy of its parts would
leave in order. So `copy.deepcopy` takes a twin, which shares town and tables as they never change,
and `pickle` says how the environment was made; both then restore what `save_state` gives. Wrappers
are copied as Gymnasium's are, with what they hold.
"""

from __future__ import annotations

import abc
import copy
from collections.abc import Mapping
from typing import Any, ClassVar

from typing_extensions import Self


class Copyable(abc.ABC):
    """What an environment gains that can save itself, make a twin, and says how it was made."""

    SPACES: ClassVar[tuple[str, ...]]  # attributes that draw samples, and so have a memory
    _made_with: Mapping[str, Any]  # arguments of `__init__`
    _parts: frozenset[str]  # attributes that `__init__` makes; others are the user's

    @abc.abstractmethod
    def save_state(self) -> Any:
        """A value from which `restore_state` brings everything back."""

    @abc.abstractmethod
    def restore_state(self, snapshot: Any) -> None:
        """Puts back what `save_state` returned, of this environment or of one made like it."""

    @abc.abstractmethod
    def twin(self) -> Self:
        """Another environment like this one, not begun; it shares what never changes."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        twin = self.twin()
        memo[id(self)] = twin
        for name in self._parts:  # who holds a part of this one shall hold that of the copy
            if hasattr(part := vars(self).get(name), "__dict__"):
                memo[id(part)] = vars(twin)[name]
        vars(twin).update(copy.deepcopy(self._added(), memo))
        twin.restore_state(self.save_state())
        return twin

    def __reduce__(self) -> tuple[Any, ...]:
        base = next(kind for kind in type(self).__mro__ if "SPACES" in vars(kind))
        spaces = {name: vars(self)[name] for name in self.SPACES}
        state = (self.save_state(), {**spaces, **self._added()})
        return _made_again, (type(self), base, dict(self._made_with)), state

    def __setstate__(self, state: tuple[Any, dict[str, Any]]) -> None:
        snapshot, attributes = state
        vars(self).update(attributes)
        self.restore_state(snapshot)

    def _remember(self, made_with: Mapping[str, Any], before: frozenset[str]) -> None:
        """The end of `__init__`: notes its arguments, and which attributes were there before."""
        self._made_with = dict(made_with)
        self._parts = frozenset(vars(self)) - before | {"_parts"}

    def _added(self) -> dict[str, Any]:
        """What others than `__init__` have put here, such as Gymnasium its `spec`."""
        return {name: value for name, value in vars(self).items() if name not in self._parts}

    def _shallow(self) -> Self:
        """The same parts in another object, with which a twin begins."""
        other = type(self).__new__(type(self))
        vars(other).update(vars(self))
        return other


def _made_again(kind: type[Any], base: type[Any], made_with: Mapping[str, Any]) -> Any:
    """An environment of a class, or of one derived from it, as `base` makes it."""
    env = object.__new__(kind)
    base.__init__(env, **made_with)
    return env
