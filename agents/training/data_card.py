"""What a folder of collected drives holds: its files, and a card of their counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agents.training.collect import EXPERT
from agents.training.frames import FRAME_S, RecordedDrive, read_drive, read_dropped
from agents.training.towns import training_plan
from di_envs.town.plan import RoadOption

CARD_FILE = "card.json"
WEATHER_NOTE = "none: it is drawn from 14 presets whenever a moment is rendered"


def drive_paths(folder: Path) -> list[Path]:
    """The files of all drives that were kept, in order of town and number."""
    return sorted(folder.glob("*/[0-9]*.npz"))


def data_card(folder: Path) -> Mapping[str, Any]:
    """Counts of what a folder holds: by town, by command, by scenario, and what was dropped.

    Raises:
        DriveFileError: If a file there is not whole.
    """
    towns, commands, scenarios = Counter[str](), Counter[str](), Counter[str]()
    drivers = Counter[str]()
    for path in drive_paths(folder):
        drive = read_drive(path)
        towns[path.parent.name] += len(drive)
        scenarios.update(drive.facts["scenarios"])
        commands.update(_commands(drive))
        drivers[drive.facts.get("driver", EXPERT)] += len(drive)
    dropped = Counter[str]()
    for path in sorted(folder.glob("*/*.dropped.json")):
        dropped[read_dropped(path)["why"]] += 1
    return {
        "moments": sum(towns.values()),
        "seconds_apart": FRAME_S,
        "drives": len(drive_paths(folder)),
        "by_driver": dict(drivers),
        "by_town": dict(sorted(towns.items())),
        "by_command": dict(commands.most_common()),
        "by_scenario": dict(sorted(scenarios.items())),
        "dropped": dict(dropped.most_common()),
        "weather": WEATHER_NOTE,
    }


def _commands(drive: RecordedDrive) -> Counter[str]:
    """How many moments were driven under each command."""
    plan = training_plan(str(drive.facts["town"]), str(drive.facts["route_id"]))
    targets = drive.whole["target_index"][:, 0]
    options = plan.option[plan.targets[targets]]
    return Counter(RoadOption(int(option)).name.lower() for option in options)
