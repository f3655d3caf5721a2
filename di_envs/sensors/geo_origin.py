"""The place on Earth of a map's x = y = 0, by which GNSS counts.

CARLA's Town05 lies at 49 degrees north, 8 east in some of its versions and at 0, 0 in others, and
many agents have the latter in their code. Here it can be chosen.
"""

from __future__ import annotations

from collections.abc import Sequence

STEEPEST_DEG = 85.0  # north and south; beyond it Mercator's map is of no use


def checked_origin(given: Sequence[float | str]) -> tuple[float, float]:
    """Latitude and longitude [deg] of an origin.

    Raises:
        ValueError: If it is not two such numbers.
    """
    try:
        latitude, longitude = (float(value) for value in given)
    except (TypeError, ValueError):
        latitude = longitude = float("nan")
    if not (abs(latitude) <= STEEPEST_DEG and abs(longitude) <= 180.0):
        raise ValueError(
            f"A map's origin is its latitude, within {STEEPEST_DEG:g} degrees of the equator, and "
            f"its longitude, within 180, such as (49.0, 8.0); got {given!r}."
        )
    return latitude, longitude
