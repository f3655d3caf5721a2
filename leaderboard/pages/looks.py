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
QUIET_SHARE = 0.01  # a map that moves the waypoints by less than that beside a component is small


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


def map_columns(maps: ActivationMaps, gradient: NDArray[np.float32]) -> dict[str, Column]:
    """Maps as shares of the peak that each has: cells, then peaks, then how much all cells are.

    Args:
        maps: The maps.
        gradient: (N, G, 2) the components' at the same moments.
    """
    peaks = maps.values.max(axis=(1, 2)).astype(np.float64)
    shares = maps.values / np.where(peaks > 0.0, peaks, 1.0)[:, None, None]
    of_components = map_shares(maps, gradient)
    return {
        "cells": Column(values=shares, step=1.0 / GREYS, differences=0),
        "peak": Column(values=peaks, step=max(float(peaks.max()) * _FINE, 1e-12)),
        "share": Column(values=of_components, step=max(float(of_components.max()) * _FINE, 1e-12)),
    }


def map_shares(maps: ActivationMaps, gradient: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N,) all of a map's cells together, as a share of the largest component's gradient, up to 1.

    A cell says how far, in metres, what it holds moves the waypoints, to first order; a gradient
    how far a step of unit length in a component's tokens does. Their orders can be compared.
    """
    together = maps.values.sum(axis=(1, 2), dtype=np.float64)
    largest = np.abs(gradient).max(axis=(1, 2), initial=0.0).astype(np.float64)
    return np.minimum(together, largest) / np.where(largest > 0.0, largest, 1.0)
