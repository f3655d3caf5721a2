"""The example agent for CARLA's Leaderboard, finding its place as agents for CARLA 0.9.10 do.

    driveinsight evaluate --agent "carla:tests/agents/carla/by_constants.py?path=examples" \\
        --suite town05_tiny

Those have a place's origin and scale in their code, where the example reads both off its route.
"""

from __future__ import annotations

import carla_leaderboard_agent as example

METRES_PER_DEGREE = (111324.60662786, 111319.490945)  # to the north, to the east


def get_entry_point():
    """The Leaderboard asks for the name of the class."""
    return "ByConstants"


class Way(example.Way):
    """A route in metres from 0°, 0°."""

    def metres(self, latitude, longitude):
        """Of a place, east and south."""
        north, east = latitude * METRES_PER_DEGREE[0], longitude * METRES_PER_DEGREE[1]
        return east, -north


class ByConstants(example.RouteFollower):
    """The example's driver on that way."""

    def run_step(self, input_data, timestamp):
        """A control, as the example's."""
        if self.way is None:
            self.way = Way(self._global_plan, self._global_plan_world_coord)
        return super().run_step(input_data, timestamp)
