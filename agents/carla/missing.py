"""What CARLA has and this world has not says so, with the nearest that there is."""

from __future__ import annotations

from typing import NoReturn

from di_envs.files.names import name_hint


def say_missing(owner: object, name: str) -> NoReturn:
    """Raises for an attribute that an object of ours, which stands for one of CARLA's, lacks.

    Raises:
        AttributeError: Always; lists what there is.
    """
    if name.startswith("__"):
        raise AttributeError(name)
    kind = owner if isinstance(owner, type) else type(owner)
    known = [key for base in kind.__mro__ for key in vars(base) if not key.startswith("_")]
    known += [key for key in vars(owner) if not key.startswith("_")]
    hint = name_hint(name, sorted(set(known)))
    raise AttributeError(f"{kind.__name__} has no {name} here: nothing simulates it; {hint}")
