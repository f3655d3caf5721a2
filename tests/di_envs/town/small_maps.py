"""OpenDRIVE text for tests, small enough to follow on paper."""

from __future__ import annotations

import math
import re
from pathlib import Path

from di_envs.town.loading import load_town
from di_envs.town.town import Town


def lane(
    lane_id: int,
    *,
    kind: str = "driving",
    width: str = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>',
    predecessor: int | None = None,
    successor: int | None = None,
    mark: str = "",
    speed: str = "",
) -> str:
    """A lane; `width` is XML so that it may change along the lane."""
    links = "".join(
        f'<{name} id="{other}"/>'
        for name, other in (("predecessor", predecessor), ("successor", successor))
        if other is not None
    )
    body = (width if lane_id else "") + mark + speed
    return f'<lane id="{lane_id}" type="{kind}"><link>{links}</link>{body}</lane>'


def section(s: float, *lanes: str, centre: str = "") -> str:
    """A lane section; lanes go to the side of their ids."""
    left = "".join(text for text in lanes if '<lane id="-' not in text)
    right = "".join(text for text in lanes if '<lane id="-' in text)
    middle = f'<center><lane id="0" type="none">{centre}</lane></center>'
    return f'<laneSection s="{s}"><left>{left}</left>{middle}<right>{right}</right></laneSection>'


def geometry(length: float, *, s=0.0, x=0.0, y=0.0, heading=0.0, shape: str = "<line/>") -> str:
    """One piece of a reference line."""
    return (
        f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}">'
        f"{shape}</geometry>"
    )


def road(
    road_id: str,
    length: float,
    *sections: str,
    line: str | None = None,
    links: str = "",
    junction: str = "-1",
    rule: str = "RHT",
    before: str = "",
    offset: str = "",
    after: str = "",
    x: float = 0.0,
    y: float = 0.0,
    heading: float = 0.0,
) -> str:
    """A road, straight unless `line` says otherwise."""
    line = geometry(length, x=x, y=y, heading=heading) if line is None else line
    return (
        f'<road id="{road_id}" length="{length!r}" junction="{junction}" rule="{rule}">'
        f"<link>{links}</link>{before}<planView>{line}</planView>"
        f"<lanes>{offset}{''.join(sections)}</lanes>{after}</road>"
    )


def opendrive(*elements: str, header: str = "") -> str:
    """A whole file."""
    return (
        f'<?xml version="1.0"?><OpenDRIVE><header>{header}</header>{"".join(elements)}</OpenDRIVE>'
    )


def load(text: str, folder: Path, signals: str | Path | None = "none") -> Town:
    """The town of a text, through a file and a cache of its own."""
    path = folder / "small.xodr"
    path.write_text(text, encoding="utf-8")
    return load_town(path, signals, cache_folder=folder / "cache")


def one_street(length: float = 100.0, **options: object) -> str:
    """A street of one lane each way along x."""
    return opendrive(road("1", length, section(0.0, lane(1), lane(-1)), **options))  # type: ignore[arg-type]


def crossing(lanes_each_way: int = 1, signals: str = "", turned: float = 0.0) -> str:
    """Four streets of 80 m that end 10 m from the origin, joined straight on.

    Traffic into junction 9 runs on the streets' right lanes. Street 1 comes from the east, 2 from
    the south (world y is positive there), 3 from the west, 4 from the north; the whole of it
    `turned` [rad] counter-clockwise.
    """
    ids = range(1, lanes_each_way + 1)
    streets, ways, connections = [], [], []
    headings = (3.141592653589793, 1.5707963267948966, 0.0, -1.5707963267948966)
    for k, heading in enumerate(unturned + turned for unturned in headings):
        x, y = -90.0 * math.cos(heading), -90.0 * math.sin(heading)
        street = section(0.0, *(lane(i) for i in ids), *(lane(-i) for i in ids))
        link = '<successor elementType="junction" elementId="9"/>'
        after = signals if k == 0 else ""
        streets.append(
            road(str(k + 1), 80.0, street, links=link, x=x, y=y, heading=heading, after=after)
        )
        x, y = -10.0 * math.cos(heading), -10.0 * math.sin(heading)
        target = (k + 2) % 4 + 1
        name = str(11 + k)
        link = (
            f'<predecessor elementType="road" elementId="{k + 1}" contactPoint="end"/>'
            f'<successor elementType="road" elementId="{target}" contactPoint="end"/>'
        )
        way = section(0.0, *(lane(-i, predecessor=-i, successor=i) for i in ids))
        ways.append(road(name, 20.0, way, links=link, junction="9", x=x, y=y, heading=heading))
        pairs = "".join(f'<laneLink from="{-i}" to="{-i}"/>' for i in ids)
        connections.append(
            f'<connection id="{k}" incomingRoad="{k + 1}" connectingRoad="{name}" '
            f'contactPoint="start">{pairs}</connection>'
        )
    junction = f'<junction id="9" name="crossing">{"".join(connections)}</junction>'
    return opendrive(*streets, *ways, junction)


def left_handed(text: str) -> str:
    """The same map seen in a mirror along its roads' lines: lane -1 is lane 1, driven on the left.

    For maps of streets that run along their own lines, straight on through junctions.
    """
    swapped = re.sub(
        r'(<lane id|<predecessor id|<successor id|from|to)="(-?[1-9][0-9]*)"',
        lambda found: f'{found[1]}="{-int(found[2])}"',
        text,
    )
    for old, new in (("left>", "x>"), ("right>", "left>"), ("x>", "right>"), ("RHT", "LHT")):
        swapped = swapped.replace(old, new)
    return swapped
