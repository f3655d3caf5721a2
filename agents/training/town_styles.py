"""How the towns that policies are trained in look: their blocks, streets, lights and traffic.

Their styles are those of CARLA's other towns; Town05 is not among them, nor anything like it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from agents.training.street_grids import TownStyle

_STREET = {"lanes": 1, "speed_kmh": 40.0}
_AVENUE = {"lanes": 2, "speed_kmh": 50.0}
_PARKED = {"lanes": 2, "speed_kmh": 50.0, "parking_m": 3.0}
_LANE = {"lanes": 1, "speed_kmh": 30.0, "parking_m": 2.0}
_HIGHWAY = {"lanes": 3, "speed_kmh": 80.0, "median_m": 3.5, "shoulder_m": 3.5, "sidewalk_m": 0.0}
_COUNTRY = {"lanes": 1, "speed_kmh": 70.0, "shoulder_m": 1.5, "sidewalk_m": 0.0}

TRAINING_TOWNS: Mapping[str, TownStyle] = MappingProxyType(
    {
        "small_grid": TownStyle(
            columns=5,
            rows=4,
            block_m=(75.0, 110.0),
            sections={"street": _STREET},
            lines=("street",),
            vehicles=60,
        ),
        "large_grid": TownStyle(
            columns=5,
            rows=5,
            block_m=(90.0, 140.0),
            sections={"avenue": _AVENUE, "parked": _PARKED},
            lines=("avenue", "parked"),
            lights=0.8,
            vehicles=90,
            walkers=60,
        ),
        "suburb": TownStyle(
            columns=5,
            rows=5,
            block_m=(80.0, 150.0),
            sections={"street": _STREET, "lane": _LANE},
            lines=("street", "lane"),
            missing=0.3,
            lights=0.3,
            bend_m=14.0,
            shift_m=4.0,
            vehicles=50,
            walkers=60,
        ),
        "highways": TownStyle(
            columns=4,
            rows=3,
            block_m=(180.0, 260.0),
            sections={"highway": _HIGHWAY, "avenue": _AVENUE},
            lines=("highway", "avenue"),
            missing=0.25,
            lights=0.8,
            vehicles=90,
            walkers=20,
        ),
        "rural": TownStyle(
            columns=4,
            rows=3,
            block_m=(180.0, 280.0),
            sections={"country": _COUNTRY, "street": _STREET},
            lines=("country", "country", "street"),
            missing=0.3,
            lights=0.35,
            bend_m=22.0,
            shift_m=6.0,
            vehicles=40,
            walkers=10,
        ),
        "downtown": TownStyle(
            columns=6,
            rows=4,
            block_m=(80.0, 125.0),
            sections={"avenue": _AVENUE, "street": _STREET, "parked": _PARKED},
            lines=("avenue", "street", "parked"),
            missing=0.15,
            lights=0.9,
            vehicles=90,
            walkers=80,
        ),
        "mixed": TownStyle(
            columns=5,
            rows=4,
            block_m=(90.0, 200.0),
            sections={"avenue": _AVENUE, "street": _STREET, "highway": _HIGHWAY},
            lines=("avenue", "street", "highway"),
            missing=0.25,
            lights=0.5,
            bend_m=16.0,
            vehicles=80,
        ),
    }
)

# Two towns more. Of the first eyes learn what stands beside and under roads elsewhere: decks,
# rails, pillars. In the other planners learn what routes of CARLA's Town05 ask for and those of the
# seven do not: to change lane within the last metres before a junction's line, beside its queue
MADE_TOWNS: Mapping[str, TownStyle] = MappingProxyType(
    {
        **TRAINING_TOWNS,
        "viaducts": TownStyle(
            columns=4,
            rows=3,
            block_m=(170.0, 240.0),
            sections={"highway": _HIGHWAY, "avenue": _AVENUE, "parked": _PARKED},
            lines=("highway", "avenue", "parked"),
            lights=0.8,
            bend_m=12.0,
            raised=0.6,
            vehicles=150,
            walkers=60,
        ),
        "late_changes": TownStyle(
            columns=5,
            rows=4,
            block_m=(110.0, 180.0),
            sections={"highway": _HIGHWAY, "avenue": _AVENUE, "parked": _PARKED},
            lines=("highway", "avenue", "avenue", "parked"),
            lights=0.9,
            bend_m=12.0,
            late_changes=1.0,
            vehicles=150,
            walkers=50,
        ),
    }
)
