"""Rewrites `golden.json`: `python -m tests.golden.record`.

A drive that is as it was is kept, and gets the bits of this machine's footing beside those of
others. One whose settings or version are others is recorded anew. One that moved under the same
version is refused: the version comes first.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from tests.golden.drives import GOLDEN, drive, entry_of, label, moved, outdated, recorded_controls

FILE = Path(__file__).with_name("golden.json")


def read() -> dict[str, Any]:
    """All that is recorded, by name."""
    content: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    return content


def recorded(name: str, entry: dict[str, Any] | None) -> dict[str, Any]:
    """A drive's record for today.

    Raises:
        ValueError: If it moved, and no version was raised.
    """
    golden = GOLDEN[name]
    if entry is None or outdated(golden, entry):
        return entry_of(golden, drive(golden))
    driven, here = drive(golden, recorded_controls(entry)), label(golden)
    if problem := moved(name, entry, driven, bits=here in entry["exact"]):
        raise ValueError(problem)
    return {**entry, "exact": {**entry["exact"], here: dict(driven.hashes)}}


def main() -> int:
    """Records all drives; 1 if one of them moved, and then nothing is written."""
    before, after, problems = read(), {}, []
    for name in GOLDEN:
        print(name, flush=True)
        try:
            after[name] = recorded(name, before.get(name))
        except ValueError as error:
            problems.append(str(error))
    if problems:
        print(*problems, sep="\n", file=sys.stderr)
        return 1
    lines = (f" {json.dumps(name)}: {json.dumps(entry)}" for name, entry in after.items())
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
