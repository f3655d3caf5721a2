"""What was seen inside a policy, moment by moment, as columns that a page can hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.world.state import TICK_S
from leaderboard.explaining.explanation import ActivationMaps, Explanation
from leaderboard.records.blocks import Column
from leaderboard.replaying.film import SHARE_STEP

_FINE = 2.0**-16  # of the largest gradient: what one is rounded to
_SHARE_STEP = 2.0**-12  # of a share of attention
_WAYPOINT_STEP = 0.001
GREYS = 255  # of a map's peak: what its cells are rounded to
QUIET_SHARE = 0.01  # of the largest component's gradient: a map whose own is less is small


def look_columns(explanation: Explanation) -> dict[str, Column]:
    """Moments, controls, waypoints, gradients and attention, each component's in columns."""
    controls = explanation.controls
    columns = {"tick": Column(values=np.rint(explanation.times_s / TICK_S))}
    for index, name in enumerate(("throttle", "steer", "brake")):
        columns[name] = Column(values=controls[:, index], step=SHARE_STEP)
    for index, name in enumerate(("waypoints_x", "waypoints_y")):
        numbers = explanation.waypoints[:, :, index].T  # a waypoint after the other
        columns[name] = Column(values=numbers, step=_WAYPOINT_STEP)
    step = gradient_step(explanation.gradient)
    for g in range(len(explanation.groups)):
        for c, name in enumerate(("gradient_x", "gradient_y")):
            columns[f"{name}_{g}"] = Column(values=explanation.gradient[:, g, c], step=step)
        shares = explanation.attention[..., g].transpose(1, 2, 0)  # (layers, heads, N)
        columns[f"attention_{g}"] = Column(values=shares, step=_SHARE_STEP)
    return columns


def gradient_step(gradient: NDArray[np.float32]) -> float:
    """What gradients are rounded to: a small share of the largest one."""
    return max(float(np.abs(gradient).max(initial=0.0)) * _FINE, 1e-12)


def map_columns(maps: ActivationMaps, shares: NDArray[np.float64]) -> dict[str, Column]:
    """Maps as shares of the peak that each has: cells, then peaks, then how much they matter.

    Args:
        maps: The maps.
        shares: (N,) see `map_shares`.
    """
    peaks = maps.values.max(axis=(1, 2)).astype(np.float64)
    cells = maps.values / np.where(peaks > 0.0, peaks, 1.0)[:, None, None]
    return {
        "cells": Column(values=cells, step=1.0 / GREYS, differences=0),
        "peak": Column(values=peaks, step=max(float(peaks.max()) * _FINE, 1e-12)),
        "share": Column(values=shares, step=_FINE),
    }


def map_shares(explanation: Explanation, name: str) -> NDArray[np.float64]:
    """(N,) how much a map matters: its component's gradient as a share of the largest one.

    What cameras see reaches the decision through the component `bev`, as no component has a
    camera's name. A map of which no component tells counts as the largest.
    """
    groups, strength = explanation.groups, np.abs(explanation.gradient).max(axis=2, initial=0.0)
    found = [group for group in (name, "bev") if group in groups]
    if not found:
        return np.ones(len(strength))
    largest = strength.max(axis=1, initial=0.0).astype(np.float64)
    return np.where(
        largest > 0.0,
        strength[:, groups.index(found[0])] / np.where(largest > 0.0, largest, 1.0),
        1.0,
    )
