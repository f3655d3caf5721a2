"""Which routes of a file are for the town that is loaded, and what is to be said of the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from di_envs.files.names import check_name
from di_envs.town.routing.road_graph import RoadGraph
from di_envs.town.routing.routes import BrokenRoute, RouteFileError, RouteSpec

FAR_M = 10.0  # from a keypoint to its lane: farther than on any road that it was written for
MOST = 0.5  # share of far keypoints above which a file fits another town


class OfTown(NamedTuple):
    """The routes of a file that are driven in a town."""

    specs: list[RouteSpec]
    broken: dict[str, str]  # why others cannot be read, by their id
    elsewhere: dict[str, str]  # towns of the routes that are left out, by their id
    written_for: str  # the other town that all routes name; empty if they name this one


def routes_of_town(
    specs: Sequence[RouteSpec], broken: Sequence[BrokenRoute], town: str | None, file: str
) -> OfTown:
    """Those of a town, by its name in any case; all, where the file names one other town only.

    Args:
        specs: The routes of the file.
        broken: Those that cannot be read.
        town: Name of the town that is loaded; None takes all.
        file: What messages call the file.

    Raises:
        RouteFileError: If the file is for several towns, and this is none of them.
    """
    towns = dict.fromkeys(spec.town for spec in specs)
    folded = {name.casefold() for name in towns}
    fits = town is None or town.casefold() in folded
    if town is None or len(folded) == 1:
        written_for = "" if fits else specs[0].town
        return OfTown(list(specs), {each.route_id: each.why for each in broken}, {}, written_for)
    if not fits:
        raise RouteFileError(
            f"{file}: no route is in town '{town}'; its towns: {', '.join(towns)}. Choose one "
            "with --town, or a route file for this one."
        )
    here = town.casefold()
    return OfTown(
        [spec for spec in specs if spec.town.casefold() == here],
        {each.route_id: each.why for each in broken if each.town.casefold() == here},
        {spec.route_id: spec.town for spec in specs if spec.town.casefold() != here},
        "",
    )


def those_asked_for(found: OfTown, route_ids: Sequence[str] | None, file: str) -> OfTown:
    """Those of some ids, in the order of the file; all for None.

    Raises:
        ValueError: If an id is unknown, or is a route's of another town.
        RouteFileError: If none of them can be read.
    """
    if route_ids is None:
        return found
    wanted = [str(route_id) for route_id in route_ids]
    known = [*(spec.route_id for spec in found.specs), *found.broken]
    for route_id in wanted:
        if route_id in found.elsewhere:
            raise ValueError(
                f"Route '{route_id}' of {file} is in {found.elsewhere[route_id]}; choose that town "
                f"with --town, or one of the routes here: {', '.join(known)}."
            )
        check_name(route_id, known, f"route id in {file}")
    specs = [spec for spec in found.specs if spec.route_id in wanted]
    broken = {route_id: why for route_id, why in found.broken.items() if route_id in wanted}
    if broken and not specs:
        raise RouteFileError(next(iter(broken.values())))
    return found._replace(specs=specs, broken=broken)


def remark_on_towns(graph: RoadGraph, found: OfTown, file: str) -> str:
    """What is to be said of a file's towns, empty if nothing.

    Args:
        graph: Of the town that is loaded.
        found: The file's routes for it.
        file: What messages call the file.

    Raises:
        RouteFileError: If the file was written for another town, and most of its keypoints lie far
            from every lane of this one.
    """
    name = graph.town.name
    if found.elsewhere:
        counts = Counter(found.elsewhere.values())
        others = ", ".join(f"{count} of {town}" for town, count in counts.items())
        here = len(found.specs) + len(found.broken)
        return (
            f"{file}: {here} of {here + len(found.elsewhere)} routes are of {name}; left out: "
            f"{others}."
        )
    if not found.written_for:
        return ""
    positions = np.concatenate([spec.positions for spec in found.specs])
    away_m = np.array([graph.snap(position).distance_m for position in positions])
    far = int((away_m > FAR_M).sum())
    if far > MOST * len(positions):
        raise RouteFileError(
            f"{file} was written for {found.written_for}, and {far} of its {len(positions)} "
            f"keypoints lie over {FAR_M:g} m from every lane of {name}: drive it with the map of "
            f"{found.written_for} (--town)."
        )
    return (
        f"{file} was written for {found.written_for}, not for {name}; {far} of its "
        f"{len(positions)} keypoints lie over {FAR_M:g} m from every lane here."
    )
