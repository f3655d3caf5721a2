# mypy: disallow_untyped_defs=False
"""IMU and GNSS as CARLA's Leaderboard mounts them, with its noise, as functions of the state.

Source: noise as set by the Leaderboard's agent wrapper; compass and axes as in CARLA's IMU sensor
(x ahead, y right, z up; compass clockwise from north, which is -y); geodesy by Mercator around the
map's origin, as in the Leaderboard's route manipulation. The noise is keyed by seed and tick, so a
sensor that is added or read twice changes nothing.
"""

from __future__ import annotations

import math

from di_envs.geometry import wrap_angle
from di_envs.kernels import kernel
from di_envs.keyed_random import Stream, normal

GRAVITY_MPS2 = 9.81
ACCELERATION_NOISE_MPS2 = (0.001, 0.001, 0.015)
GYROSCOPE_NOISE_RADPS = 0.001
GNSS_NOISE = 5e-6  # degrees for latitude and longitude, metres for altitude
EARTH_RADIUS_M = 6378137.0
IMU_LIMIT = 99.9  # CARLA's, for accelerations [m/s2] and rates [rad/s]

_IMU, _GNSS = int(Stream.IMU), int(Stream.GNSS)
_CHANNELS = 8  # keys kept apart for each ego; an IMU draws six


@kernel
def fill_imu(state, ego, out):
    """Writes accelerations [m/s2], angular rates [rad/s] and the compass [rad], CARLA's order.

    The road is taken as level: the ego has no pitch or roll, and z shows gravity alone.

    Args:
        state: `State` of the world.
        ego: The ego's index.
        out: (7,) ax, ay, az, gx, gy, gz, compass in [0, 2 pi).
    """
    out[0] = state.acceleration[ego]
    out[1] = state.speed[ego] * state.yaw_rate[ego]
    out[2] = GRAVITY_MPS2
    out[3] = 0.0
    out[4] = 0.0
    out[5] = state.yaw_rate[ego]
    for channel in range(6):
        noise = ACCELERATION_NOISE_MPS2[channel] if channel < 3 else GYROSCOPE_NOISE_RADPS
        draw = normal(state.seed[()], _IMU, state.tick[()], ego * _CHANNELS + channel)
        out[channel] = min(max(out[channel] + noise * draw, -IMU_LIMIT), IMU_LIMIT)
    out[6] = wrap_angle(state.yaw[ego] - 0.5 * math.pi) + math.pi


@kernel
def geodetic(x, y, origin_latitude, origin_longitude):
    """Latitude and longitude [deg] of a world point [m], by Mercator; north is -y."""
    scale = math.cos(math.radians(origin_latitude))
    east = scale * EARTH_RADIUS_M * math.radians(origin_longitude) + x
    north = scale * EARTH_RADIUS_M * math.log(math.tan(math.radians(90.0 + origin_latitude) / 2.0))
    north -= y
    longitude = math.degrees(east / (EARTH_RADIUS_M * scale))
    latitude = 2.0 * math.degrees(math.atan(math.exp(north / (EARTH_RADIUS_M * scale)))) - 90.0
    return latitude, longitude


@kernel
def fill_gnss(state, ego, origin_latitude, origin_longitude, out):
    """Writes latitude [deg], longitude [deg] and altitude [m].

    Args:
        state: `State` of the world.
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
