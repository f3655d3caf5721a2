"""The report's map: the town, the way of each drive, and a mark for each infraction, as SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from di_envs.town.town import Town
from di_envs.world.event_names import EVENT_KEYS
from leaderboard.pages.markup import Markup, element
from leaderboard.pages.report_tables import event_text, met, shown_events
from leaderboard.pages.town_svg import CM, line_path, simplified, town_bounds, town_svg
from leaderboard.records.record import RouteRecord, RunRecord


def map_svg(run: RunRecord, records: Sequence[RouteRecord], town: Town) -> Markup:
    """The town with the ways of some drives and their infractions; each links to its moment."""
    bounds = town_bounds(town)
    box = " ".join(f"{v * CM:.0f}" for v in (bounds.left, bounds.top, bounds.width, bounds.height))
    marks = [mark for record in records for mark in _marks(run, record)]
    ways = [_way(record) for record in records if len(record.trace) > 1]
    return element(
        "svg",
        element("g", Markup(town_svg(town)), id="town"),
        element("g", *ways, id="ways"),
        element("g", *marks, id="marks"),
        id="map",
        viewBox=box,
        role="group",
        aria_label=f"Map of {town.name} with all infractions",
        style=f"--mark: {max(bounds.width, bounds.height) * CM / 1000:.1f}",
    )


def _way(record: RouteRecord) -> Markup:
    points = simplified(np.array(record.trace)[:, 1:3], 0.2)
    name = f"route {record.route_id}, seed {record.seed}"
    path = element("path", element("title", name), d=line_path(points))
    return element("a", path, href=f"#route={record.route_id}&seed={record.seed}&t=0", tabindex=-1)


def _marks(run: RunRecord, record: RouteRecord) -> Iterator[Markup]:
    for event in shown_events(record, run):
        kind = EVENT_KEYS[event.kind]
        met_text = f" ({met(event)})" if met(event) else ""
        label = (
            f"{event_text(event)}{met_text}, {event.time_s:.1f} s, "
            f"route {record.route_id}, seed {record.seed}"
        )
        use = element("use", href=f"#mark-{kind}")
        place = f"transform: translate({event.x * CM:.0f}px, {event.y * CM:.0f}px)"
        yield element(
            "a",
            element("title", label),
            element("g", use, class_=f"mark kind-{kind}"),
            style=place,
            href=f"#route={record.route_id}&seed={record.seed}&t={event.time_s:.2f}",
            aria_label=label,
        )
