"""How the expert drives: speeds, gaps and margins, as a documented value."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple


class ExpertNumbers(NamedTuple):
    """`ExpertConfig` for kernels: the same numbers under the same names."""

    limit_factor: float
    lateral_mps2: float
    corner_braking_mps2: float
    acceleration_mps2: float
    braking_mps2: float
    emergency_mps2: float
    time_gap_s: float
    standstill_gap_m: float
    side_margin_m: float
    line_margin_m: float
    red_margin_s: float
    walker_margin_m: float
    walker_gap_m: float
    wary_mps: float
    kerb_sight_m: float
    runner_mps: float
    exit_gap_m: float
    clear_before_s: float
    clear_after_s: float
    change_time_s: float
    change_front_mps2: float
    change_rear_mps2: float
    dt_s: float
    ignore_actors: bool
    ignore_lights: bool
    ignore_signs: bool


@dataclass(frozen=True, kw_only=True)
class ExpertConfig:
    """A careful and brisk driver. Decelerations are positive."""

    limit_factor: float = 1.0  # of the speed limit
    lateral_mps2: float = 3.0  # in corners
    corner_braking_mps2: float = 2.5  # when slowing down for a corner or a lower limit
    acceleration_mps2: float = 3.0
    braking_mps2: float = 3.0  # planned braking, for lines and people
    emergency_mps2: float = 8.0  # hardest braking
    time_gap_s: float = 1.0  # to the vehicle ahead
    standstill_gap_m: float = 2.5  # to the vehicle ahead
    side_margin_m: float = 0.3  # added to each side of the car when others lie on its path
    line_margin_m: float = 0.7  # between the front and a stop line
    red_margin_s: float = 0.4  # the tail is over the line this long before red
    walker_margin_m: float = 0.7  # added to each side of the car for walkers
    walker_gap_m: float = 2.5  # between the front and a walker
    wary_mps: float = 9.0  # where it is told that somebody hides beside the road
    kerb_sight_m: float = 10.0  # before the car, where somebody may step off a walkway
    runner_mps: float = 4.0  # how fast he may run
    exit_gap_m: float = 2.0  # room kept free behind those beyond a junction
    clear_before_s: float = 0.4  # another has left a crossing this long before the expert comes
    clear_after_s: float = 1.2  # the expert has left it this long before another comes
    change_time_s: float = 3.0  # a lane change takes
    change_front_mps2: float = 2.5  # hardest braking behind the new leader
    change_rear_mps2: float = 2.0  # hardest braking asked of the new follower (MOBIL's limit)
    dt_s: float = 0.1  # between decisions
    ignore_actors: bool = False
    ignore_lights: bool = False
    ignore_signs: bool = False

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, bool) and not value > 0.0:
                raise ValueError(f"ExpertConfig.{item.name} must be positive, not {value}.")

    def numbers(self) -> ExpertNumbers:
        """The form that kernels read."""
        return ExpertNumbers(*(getattr(self, name) for name in ExpertNumbers._fields))
