"""How an ego moves under throttle, brake and steering: a bicycle fitted to CARLA's Lincoln."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes
from di_envs.town.lanes_below import lanes_below_box
from di_envs.town.queries import DRIVING_MASK, nearest_lane, pose_at
from di_envs.world.state import HISTORY_LENGTH, TICK_S, State

LOOK_M = 40.0  # for a lane; an ego this far from all of them has left its route too


@by_reference
class EgoParameters(NamedTuple):
    """`EgoModel` for kernels: the same numbers under the same names."""

    half_length_m: float
    half_width_m: float
    height_m: float
    front_axle_m: float
    rear_axle_m: float
    steer_gain_rad: float
    steer_lag_s: float
    throttle_square_mps2: float
    throttle_linear_mps2: float
    drive_fades_at_mps: float
    drag_per_s: float
    brake_mps2: float


@dataclass(frozen=True, kw_only=True)
class EgoModel:
    """CARLA's `vehicle.lincoln.mkz2017` as a kinematic bicycle.

    Steering: slip angle `beta = atan(rear / (front + rear) * tan(gain * wheel))`, yaw rate
    `speed * sin(beta) / rear`. The negative front length is the fit's: it turns the box centre,
    not an axle.
    Source: Chen, Koltun, Krähenbühl: Learning to drive from a world on rails, ICCV 2021, whose
    fitted constants these are. We add a first-order lag of the steering actuator.

    Acceleration at throttle t and speed v:
    `max(0, 9.72 t² - 2.11 t) (1 - v / 35) - 0.05 v - 8 brake`, never below standstill.
    Source: our fit to the polynomial in v and t that PDM-Lite publishes for CARLA's Lincoln at
    20 Hz (Sima et al.: DriveLM, ECCV 2024; Beißwenger: PDM-Lite, 2024). It differs from it by
    0.44 m/s² (RMS; at most 1.14) over 0 to 20 m/s and throttles from 0.3 to 1, the range that the
    polynomial is used in. Below, the polynomial brakes by 4 m/s² while our car coasts. No reverse.
    """

    half_length_m: float = 2.4508
    half_width_m: float = 1.0642
    height_m: float = 1.49
    front_axle_m: float = -0.090769015
    rear_axle_m: float = 1.4178275
    steer_gain_rad: float = 0.36848336
    steer_lag_s: float = 0.1
    throttle_square_mps2: float = 9.72
    throttle_linear_mps2: float = -2.11
    drive_fades_at_mps: float = 35.0
    drag_per_s: float = 0.05
    brake_mps2: float = 8.0

    def __post_init__(self) -> None:
        for name in ("half_length_m", "half_width_m", "height_m", "steer_lag_s", "brake_mps2"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"EgoModel.{name} must be positive, not {getattr(self, name)}.")
        if not self.front_axle_m + self.rear_axle_m > 0.0:
            raise ValueError(
                "EgoModel's wheelbase, front_axle_m + rear_axle_m, must be positive, "
                f"not {self.front_axle_m + self.rear_axle_m}."
            )

    def parameters(self) -> EgoParameters:
        """The form that kernels read."""
        return EgoParameters(*(float(getattr(self, field.name)) for field in fields(self)))


@kernel
def longitudinal_acceleration(
    speed_mps: float, throttle: float, brake: float, model: EgoParameters
) -> float:
    """Acceleration along the heading [m/s²]; throttle and brake both act, and the brake wins."""
    push = throttle * (model.throttle_square_mps2 * throttle + model.throttle_linear_mps2)
    drive = max(push, 0.0) * (1.0 - speed_mps / model.drive_fades_at_mps)
    return drive - model.drag_per_s * speed_mps - model.brake_mps2 * brake


@kernel
def pedals(acceleration: float, speed: float, model: EgoParameters) -> tuple[float, float]:
    """Throttle and brake that give an acceleration [m/s²] at a speed; standing, the brake holds.

    The inverse of `longitudinal_acceleration`, as far as the engine and the brakes go.
    """
    if speed < 0.02 and acceleration <= 0.0:
        return 0.0, 1.0
    push = acceleration + model.drag_per_s * speed
    if push <= 0.0:
        return 0.0, min(-push / model.brake_mps2, 1.0)
    push /= max(1.0 - speed / model.drive_fades_at_mps, 0.05)
    square, linear = model.throttle_square_mps2, model.throttle_linear_mps2
    throttle = (-linear + math.sqrt(linear * linear + 4.0 * square * push)) / (2.0 * square)
    return min(throttle, 1.0), 0.0


@kernel
def move_ego(state: State, ego: int, model: EgoParameters) -> None:
    """Advances one ego by a tick under its held controls, plus the noise of a loss of control.

    `state.tick` is the tick that the motion ends at: the caller counts up first, so that
    `speed_history[tick % HISTORY_LENGTH]` is always the present speed. The position is that of the
    box centre. `locate_ego` must follow, once contacts are resolved.
    """
    speed = state.speed[ego]
    throttle = min(max(state.throttle[ego] + state.throttle_noise[ego], 0.0), 1.0)
    brake = min(max(state.brake[ego], 0.0), 1.0)
    acceleration = longitudinal_acceleration(speed, throttle, brake, model)
    next_speed = max(speed + acceleration * TICK_S, 0.0)
    mean_speed = 0.5 * (speed + next_speed)

    steer = min(max(state.steer[ego] + state.steer_noise[ego], -1.0), 1.0)
    state.wheel[ego] += (steer - state.wheel[ego]) * (1.0 - math.exp(-TICK_S / model.steer_lag_s))
    wheelbase = model.front_axle_m + model.rear_axle_m
    slope = model.rear_axle_m / wheelbase * math.tan(model.steer_gain_rad * state.wheel[ego])
    beta = math.atan(slope)
    yaw_rate = mean_speed * math.sin(beta) / model.rear_axle_m

    # along the chord of the arc driven: exact for a constant yaw rate, up to its length
    course = state.yaw[ego] + beta + 0.5 * yaw_rate * TICK_S
    state.x[ego] += mean_speed * math.cos(course) * TICK_S
    state.y[ego] += mean_speed * math.sin(course) * TICK_S
    state.yaw[ego] = wrap_angle(state.yaw[ego] + yaw_rate * TICK_S)
    state.speed[ego] = next_speed
    state.acceleration[ego] = (next_speed - speed) / TICK_S
    state.yaw_rate[ego] = yaw_rate
    state.brake_light[ego] = 1 if brake > 0.0 else 0
    state.speed_history[ego, state.tick[()] % HISTORY_LENGTH] = next_speed


@kernel
def locate_ego(state: State, lanes: Lanes, ego: int) -> None:
    """Finds the lanes below an ego, and its height from the nearest one; none beyond 40 m.

    Lanes more than 2.5 m above or below it do not count, so a bridge is not the road below.
    """
    x, y, z = state.x[ego], state.y[ego], state.z[ego]
    lane, station, lateral, _distance = nearest_lane(lanes, x, y, z, LOOK_M, as_int64(DRIVING_MASK))
    state.lane[ego] = lane
    state.lane_m[ego] = station
    state.lateral_m[ego] = lateral
    if lane >= 0:
        state.z[ego] = pose_at(lanes, lane, station)[2]
    lanes_below_box(
        lanes,
        x,
        y,
        state.z[ego],
        state.yaw[ego],
        state.half_length[ego],
        state.half_width[ego],
        state.occupied[ego],
    )
