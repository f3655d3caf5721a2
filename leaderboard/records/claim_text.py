"""What a claim says of itself beside its scores: where it was driven, what its agent asked for.

Tables, pages and verdicts show the same lines, so that nobody has to look into a file for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from agents.ownership import code_of_others
from leaderboard.records.record import RunRecord

_IN_THE_TITLE = ("suite", "rules")  # options that stand there, or in a line of their own
NOT_ISOLATED = (
    "The agent is not ours and drove in the process of the world, as with --no-isolate and in "
    "branches: it could reach what its track forbids."
)


def claim_lines(run: RunRecord) -> Iterator[str]:
    """The lines, for people."""
    version = f"version {run.suite_version}" if run.suite_version else "files of the user's own"
    given = [f"{name}={_text(v)}" for name, v in run.options.items() if name not in _IN_THE_TITLE]
    said = f"; options: {', '.join(given)}" if given else "; no options"
    yield f"Driven on {run.suite} ({version}){said}."
    yield f"The agent asked for: {asked_for(run.requires)}."
    if changed := changes_of_worlds(run):
        count = sum(bool(changes) for changes in changed)
        texts = "; ".join(dict.fromkeys(text for changes in changed for text in changes))
        yield (
            f"The world of {count} of {len(changed)} routes was changed: {texts}. Their scores are "
            "not those of the suite."
        )
    if in_reach(run):
        yield NOT_ISOLATED


def changes_of_worlds(run: RunRecord) -> list[tuple[str, ...]]:
    """By route what was done to it beside the edits that the run names; empty if nothing was.

    Those of the run are of what the agent saw; a drive that `branch` made has edits of the world.
    """
    known = frozenset(run.interventions)
    found = [tuple(t for t in each.interventions if t not in known) for each in run.routes]
    return found if any(found) else []


class Claim(Protocol):
    """What says how an agent was driven: a run, or a study."""

    @property
    def agent(self) -> str: ...
    @property
    def track(self) -> str: ...
    @property
    def requires(self) -> Mapping[str, Any]: ...
    @property
    def isolated(self) -> bool: ...


def in_reach(run: Claim) -> bool:
    """Whether the agent could reach more of the world than its track allows."""
    privileged = run.requires.get("privileged", run.track == "PRIVILEGED")
    return not (run.isolated or privileged) and bool(code_of_others(run.agent))


def asked_for(requires: Mapping[str, Any]) -> str:
    """What an agent requires, in a few words."""
    parts = [" and ".join(map(str, requires.get("observations", ()))) or "nothing"]
    if requires.get("hd_map"):
        parts.append("the map")
    if requires.get("privileged"):
        parts.append("the true world")
    if requires.get("preset"):
        parts.append(f"in the preset {_text(requires['preset'])}")
    parts += [f"{name} {_text(value)}" for name, value in requires.get("options", {}).items()]
    if "control_dt_s" in requires:
        parts.append(f"a decision every {requires['control_dt_s']} s")
    return ", ".join(parts)


def _text(value: Any) -> str:
    if isinstance(value, Mapping) and isinstance(value.get("cameras"), list):
        looks = (c for c in value["cameras"] if isinstance(c, Mapping))
        each = (f"{c.get('name')} {c.get('width')}x{c.get('height')}" for c in looks)
        return f"({', '.join(each)})"
    if isinstance(value, Mapping):
        return "of its own"
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
