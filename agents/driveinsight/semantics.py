"""What lies in each BEV cell, from the simulator: the teacher of the BEV features.

Source: the paper, section 3.2, supervises the BEV feature map besides the waypoints, after Jia et
al., DriveAdapter, ICCV 2023; our teacher is the truth itself.
"""

from __future__ import annotations

from enum import IntEnum


class BevClass(IntEnum):
    """What a BEV cell holds; of several the one that is last here."""

    OTHER = 0
    ROAD = 1
    LINE = 2
    STOP = 3  # a stop line of a light, whatever it shows, or of a stop sign
    VEHICLE = 4
    WALKER = 5
