"""A moment of a world on its map, in the world frame: surfaces, signals, actors and the route."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Polygon

from di_envs.drawing.outlines import (
    ACTOR,
    BRIDGE_M,
    EDGE,
    EGO,
    LAND,
    ROUTE,
    SURFACE,
    TARGET,
    Array,
    box,
    crosswalk_bars,
    stop_line_colours,
    stop_line_ends,
    surfaces,
)
from di_envs.town.map_chunks import MapKind, build_map_chunks
from di_envs.world.state import ActorKind
from di_envs.world.world import WorldView


def draw_town(axes: Axes, view: WorldView, *, line_width: float) -> None:
    """Surfaces and lane lines; bridges last."""
    lanes = view.town.lanes
    chunks = build_map_chunks(lanes)
    for above in (False, True):
        level = 10.0 if above else 0.0
        for order, (kind, colour) in enumerate(SURFACE.items()):
            outlines = surfaces(lanes, kind, above)
            if above:  # a rim along both sides, of which the lanes cover all but the outermost
                sides = [side for outline in outlines for side in np.split(outline, 2)]
                rim: dict[str, Any] = {
                    "color": "#22262b",
                    "linewidth": 4 * line_width,
                    "capstyle": "butt",
                }
                axes.add_collection(LineCollection(sides, alpha=0.5, zorder=level - 0.5, **rim))
            surface: dict[str, Any] = {"facecolor": colour, "edgecolor": colour, "linewidth": 0.3}
            axes.add_collection(PolyCollection(outlines, zorder=level + order, **surface))
        high = chunks.points[:, :, 2].mean(axis=1) > BRIDGE_M
        for line_kind, style in ((MapKind.BROKEN_LINE, (0, (3, 4))), (MapKind.SOLID_LINE, "solid")):
            chosen = (high == above) & (chunks.kind[:, 0] == line_kind)
            axes.add_collection(
                LineCollection(
                    list(chunks.points[chosen][:, :, :2]),
                    color="white",
                    alpha=0.55 if line_kind == MapKind.SOLID_LINE else 0.4,
                    linewidth=line_width,
                    linestyle=style,
                    zorder=level + 5,
                )
            )


def draw_crosswalks(axes: Axes, view: WorldView) -> None:
    """Bars across the road."""
    bars = crosswalk_bars(view.town.crosswalks)
    axes.add_collection(PolyCollection(bars, facecolor="white", alpha=0.5, zorder=5.5))


def draw_signals(axes: Axes, view: WorldView, *, line_width: float) -> None:
    """Stop lines in the colour that their light shows."""
    lines = list(stop_line_ends(view.town.signals))
    colours = stop_line_colours(view)
    axes.add_collection(
        LineCollection(lines, colors=colours, linewidth=line_width, zorder=6, capstyle="butt")
    )


def draw_actors(
    axes: Axes, view: WorldView, *, scale: float, ego_scale: float, walker_size: float
) -> None:
    """Everybody who moves, enlarged so that a map of the whole town shows them."""
    state = view.state
    for actor in np.flatnonzero((state.kind != ActorKind.ABSENT) & (state.kind != ActorKind.PROP)):
        kind, ego = ActorKind(int(state.kind[actor])), actor == view.ego
        where = float(state.x[actor]), float(state.y[actor])
        level = 16.0 if state.z[actor] > BRIDGE_M else 8.0
        if kind == ActorKind.WALKER:
            marks: dict[str, Any] = {"markeredgecolor": EDGE, "mew": 0.5, "clip_on": True}
            axes.plot(*where, "o", color=ACTOR[kind], markersize=walker_size, zorder=level, **marks)
            continue
        size = ego_scale if ego else scale
        outline = box(
            *where,
            float(state.yaw[actor]),
            size * float(state.half_length[actor]),
            size * float(state.half_width[actor]),
        )
        colour = EGO if ego else ACTOR[kind]
        edge = "white" if ego else EDGE
        axes.add_patch(
            Polygon(outline, facecolor=colour, edgecolor=edge, linewidth=0.6, zorder=level + ego)
        )


def draw_route(axes: Axes, view: WorldView, *, line_width: float, targets: bool) -> None:
    """The dense route, what is done of it paler, and the target points still ahead."""
    plan, done = view.plans[view.ego], int(view.state.route_index[view.ego])
    xy = plan.points[:, :2]
    high = plan.points[:, 2] > BRIDGE_M
    for begin, end, alpha in ((0, done + 1, 0.35), (done, len(xy), 0.9)):
        for above in (False, True):
            line = np.where((high == above)[:, None], xy, np.nan)[begin:end]
            axes.plot(
                *line.T,
                color=ROUTE,
                alpha=alpha,
                linewidth=line_width,
                solid_capstyle="round",
                zorder=15.2 if above else 5.8,
            )
    if targets:
        ahead = plan.targets[plan.targets >= done]
        axes.plot(*xy[ahead].T, "o", color=ROUTE, markeredgecolor=TARGET, markersize=6, zorder=7)
    axes.plot(*xy[-1], "*", color=ROUTE, markeredgecolor="white", markersize=17, mew=1.2, zorder=17)


def frame(axes: Axes, title: str, low: Array, high: Array) -> None:
    """World frame with y to the south: down."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    axes.set_aspect("equal")
    axes.set_facecolor(LAND)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(title, loc="left", fontsize=12, color="#333333")
    for spine in axes.spines.values():
        spine.set_visible(False)
