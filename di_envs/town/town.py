"""A town: its lane network, signals and crosswalks, read once, shared by all, read-only."""

from __future__ import annotations

from dataclasses import dataclass

from di_envs.town.lanes import Crosswalks, Lanes, Signals


@dataclass(frozen=True, kw_only=True)
class Town:
    """What is static. Arrays are read-only; equal `content_hash` means equal content."""

    name: str
    lanes: Lanes
    signals: Signals
    crosswalks: Crosswalks
    road_names: tuple[str, ...]  # OpenDRIVE road ids, by Lanes.road
    junction_names: tuple[str, ...]  # OpenDRIVE junction ids, by Lanes.junction
    geo_origin: tuple[float, float]  # latitude, longitude [deg] of x = y = 0
    content_hash: str  # of the OpenDRIVE file and the signals
    opendrive: str  # the OpenDRIVE text
