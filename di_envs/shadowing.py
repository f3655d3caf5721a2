"""Refuses to run beside a package that hides our `agents` or `leaderboard`.

Both names are also top-level packages of CARLA's Python API, and `agents` of `openai-agents`. The
wrong one would be imported silently and fail much later; better to say at once which file is in
the way. Nothing is imported here: only the place where Python would find each name is looked up.
"""

from __future__ import annotations

import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

SHADOWED_NAMES = ("agents", "leaderboard")


def check_not_shadowed(top: Path, names: tuple[str, ...] = SHADOWED_NAMES) -> None:
    """Checks that each name leads to our package, for those that are installed beside us.

    Args:
        top: The folder that holds our top-level packages.
        names: Top-level packages to check.

    Raises:
        ImportError: If another package of that name is imported already or would be found first.
    """
    for name in names:
        ours = top / name
        if not ours.is_dir():
            continue  # a partial installation: nothing of ours to hide
        found = _folders(name)
        if found and ours.resolve() != found[0]:
            raise ImportError(
                f"`{name}` is DriveInsight's package at {ours}, but another one comes first: "
                f"{found[0]} (CARLA's Python API and openai-agents have packages of that name). "
                f"Put {top} before {found[0].parent}: "
                f"PYTHONPATH={shlex.quote(str(top))}:$PYTHONPATH driveinsight …, and not `python "
                "-m` in that folder, where it comes before all; or remove the other package",
                name=name,
                path=str(found[0]),
            )


def _folders(name: str) -> list[Path]:
    """Where Python has, or would find, a package: its folders, first one first."""
    module = sys.modules.get(name)
    if module is not None:
        origin = getattr(module, "__file__", None)
        places = [str(Path(origin).parent)] if origin else list(getattr(module, "__path__", ()))
    else:
        spec = find_spec(name)
        if spec is None:
            return []
        places = list(spec.submodule_search_locations or [str(Path(str(spec.origin)).parent)])
    return [Path(place).resolve() for place in places]
