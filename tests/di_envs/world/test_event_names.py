"""One name for an event, wherever people read of it."""

from __future__ import annotations

import re
from pathlib import Path

from di_envs.world.event_names import EVENT_KEYS, EVENT_NAMES, event_of_key
from di_envs.world.kinds import EventKind

TOP = Path(__file__).resolve().parents[3]
WRITTEN = [
    path
    for folder in ("di_envs", "agents", "wrappers", "leaderboard", "benchmarks", "docs")
    for ending in ("*.py", "*.js", "*.html", "*.md")
    for path in (TOP / folder).rglob(ending)
]


def test_every_kind_has_a_key_and_a_name_and_no_two_share_one():
    for names in (EVENT_KEYS, EVENT_NAMES):
        assert set(names) == set(EventKind)
        assert len(set(names.values())) == len(names)
    assert all(event_of_key(key) == kind for kind, key in EVENT_KEYS.items())


def test_nobody_makes_a_name_of_its_own_from_the_key():
    """Branches wrote "collision vehicle", tables "vehicle hit", the video "route deviation"."""
    other = {key.replace("_", " ") for key in EVENT_KEYS.values()} - set(EVENT_NAMES.values())
    assert other == {
        *("collision walker", "collision vehicle", "collision static"),
        *("route deviation", "min speed", "red light wide"),
        *("first hit walker", "first hit vehicle", "first hit static"),
    }
    own = re.compile(r"event\.kind\.name|(?<![\w-])kind\.name\.lower\(\)\.replace")
    wrong = []
    for path in WRITTEN:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".py" and own.search(text) and "EventKind" in text:
            wrong.append(f"{path.name} makes a name of a kind's")
        wrong += [f"{path.name}: '{name}'" for name in other if f'"{name}"' in text]
    assert not wrong
