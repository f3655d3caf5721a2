"""IMU and GNSS as CARLA's Leaderboard mounts them, with its noise, as functions of the state.

Source: noise as set by the Leaderboard's agent wrapper; compass and axes as in CARLA's IMU sensor
(x ahead, y right, z up; compass clockwise from north, which is -y); geodesy by Mercator around the
map's origin, as in the Leaderboard's route manipulation. The noise is keyed by seed and tick, so a
sensor that is added or read twice changes nothing.
"""

from __future__ import annotations

import math

from di_envs.numerics.arrays import Float32, Float64
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, normal
from di_envs.town.lanes import Lanes
from di_envs.town.queries import pose_at
from di_envs.world.state import State

GRAVITY_MPS2 = 9.81
ACCELERATION_NOISE_MPS2 = (0.001, 0.001, 0.015)
GYROSCOPE_NOISE_RADPS = 0.001
GNSS_NOISE = 5e-6  # degrees for latitude and longitude, metres for altitude
EARTH_RADIUS_M = 6378137.0
IMU_LIMIT = 99.9  # CARLA's, for accelerations [m/s2] and rates [rad/s]

_IMU, _GNSS = int(Stream.IMU), int(Stream.GNSS)
_CHANNELS = 8  # keys kept apart for each ego; an IMU draws six
_AXLE_M = 1.4  # from the ego's centre to its axles, between which the road's slope is taken


@kernel
def slope_below(state: State, lanes: Lanes, ego: int) -> tuple[float, float]:
    """Rise of the road below an ego, ahead and to the right, in metres a metre; 0 off the lanes.

    A lane rises along itself and is level across.
    """
    lane = state.lane[ego]
    if lane < 0:
        return 0.0, 0.0
    behind = max(0.0, state.lane_m[ego] - _AXLE_M)
    ahead = min(lanes.length_m[lane], state.lane_m[ego] + _AXLE_M)
    if ahead - behind < _AXLE_M:
        return 0.0, 0.0
    rise = (pose_at(lanes, lane, ahead)[2] - pose_at(lanes, lane, behind)[2]) / (ahead - behind)
    turn = pose_at(lanes, lane, state.lane_m[ego])[3] - state.yaw[ego]
    return rise * math.cos(turn), rise * math.sin(turn)


@kernel
def fill_imu(state: State, lanes: Lanes, ego: int, out: Float32) -> None:
    """Writes accelerations [m/s2], angular rates [rad/s] and the compass [rad], CARLA's order.

    As an accelerometer does, it shows gravity: at rest on a level road 9.81 upwards, on a slope a
    part of it along the road. The rates are those of a level road: pitching is left out.

    Args:
        state: Of the world.
        lanes: Of the town.
        ego: The ego's index.
        out: (7,) ax, ay, az, gx, gy, gz, compass in [0, 2 pi).
    """
    rise_x, rise_y = slope_below(state, lanes, ego)
    upright = GRAVITY_MPS2 / math.sqrt(1.0 + rise_x * rise_x + rise_y * rise_y)
    out[0] = state.acceleration[ego] + rise_x * upright
    out[1] = state.speed[ego] * state.yaw_rate[ego] + rise_y * upright
    out[2] = upright
    out[3] = 0.0
    out[4] = 0.0
    out[5] = state.yaw_rate[ego]
    for channel in range(6):
        noise = ACCELERATION_NOISE_MPS2[channel] if channel < 3 else GYROSCOPE_NOISE_RADPS
        draw = normal(state.seed[()], _IMU, state.tick[()], ego * _CHANNELS + channel)
        out[channel] = min(max(out[channel] + noise * draw, -IMU_LIMIT), IMU_LIMIT)
    out[6] = wrap_angle(state.yaw[ego] - 0.5 * math.pi) + math.pi


@kernel
def geodetic(
    x: float, y: float, origin_latitude: float, origin_longitude: float
) -> tuple[float, float]:
    """Latitude and longitude [deg] of a world point [m], by Mercator; north is -y."""
    scale = math.cos(math.radians(origin_latitude))
    east = scale * EARTH_RADIUS_M * math.radians(origin_longitude) + x
    north = scale * EARTH_RADIUS_M * math.log(math.tan(math.radians(90.0 + origin_latitude) / 2.0))
    north -= y
    longitude = math.degrees(east / (EARTH_RADIUS_M * scale))
    latitude = 2.0 * math.degrees(math.atan(math.exp(north / (EARTH_RADIUS_M * scale)))) - 90.0
    return latitude, longitude


@kernel
def fill_gnss(
    state: State, ego: int, origin_latitude: float, origin_longitude: float, out: Float64
) -> None:
    """Writes latitude [deg], longitude [deg] and altitude [m].

    Args:
        state: Of the world.
        ego: The ego's index.
        origin_latitude: Of the map's origin [deg].
        origin_longitude: Of the map's origin [deg].
        out: (3,) to write.
    """
    latitude, longitude = geodetic(state.x[ego], state.y[ego], origin_latitude, origin_longitude)
    out[0] = latitude
    out[1] = longitude
    out[2] = state.z[ego]
    for channel in range(3):
        draw = normal(state.seed[()], _GNSS, state.tick[()], ego * _CHANNELS + channel)
        out[channel] += GNSS_NOISE * draw
