"""Observations in the formats in which the CARLA Leaderboard hands them to an agent.

Every tick an agent gets `{sensor id: (frame, data)}`. Data are: of a camera (H, W, 4) uint8 in the
order blue, green, red, alpha; of the LiDAR (N, 4) float32 x, y, z [m] in the sensor's own frame (x
ahead, y right, z up, turned with its mounting) and intensity, of the rays that came back in this
tick; of GNSS latitude [deg], longitude [deg], altitude [m]; of the IMU accelerations [m/s2],
angular rates [rad/s] and the compass [rad, clockwise from north], seven float64; of the speedometer
`{"speed": m/s}`; of the map `{"opendrive": text}`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.carla.plan import moved
from di_envs.sensors.carla_suite import CarlaSensor, CarlaSuite, SensorSuiteError, SensorType

InputData = dict[str, tuple[int, Any]]


def input_data(
    suite: CarlaSuite, observation: Mapping[str, Any], frame: int, origin_latitude: float
) -> InputData:
    """What the sensors of a suite say, of one observation.

    Args:
        suite: The sensors.
        observation: Of an environment made with the suite's `observations` and `options`; with the
            `Town` under `town` where the suite has a map.
        frame: Number of the tick.
        origin_latitude: Of the town [deg].

    Raises:
        SensorSuiteError: If the observation is of an environment with other sensors.
    """
    return {
        sensor.id: (frame, _data(sensor, observation, origin_latitude)) for sensor in suite.sensors
    }


def _data(sensor: CarlaSensor, observation: Mapping[str, Any], origin_latitude: float) -> Any:
    try:
        match sensor.type:
            case SensorType.CAMERA:
                assert sensor.camera is not None
                return bgra(observation[sensor.camera.name])
            case SensorType.LIDAR:
                return lidar_points(observation["lidar"], sensor)
            case SensorType.GNSS:
                return gnss_at(observation["gnss"], observation["imu"], sensor, origin_latitude)
            case SensorType.IMU:
                return imu_turned(observation["imu"], sensor.yaw_rad)
            case SensorType.SPEEDOMETER:
                return {"speed": float(observation["speed"][0])}
            case _:
                return {"opendrive": observation["town"].opendrive}
    except KeyError as error:
        raise SensorSuiteError(
            f"Sensor '{sensor.id}': the environment was made without {error}. An agent's sensors() "
            f"are asked for once, before the first route; they must be the same for every route."
        ) from error


def bgra(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 3) red, green, blue as (H, W, 4) blue, green, red, alpha 255."""
    image = np.full((*rgb.shape[:2], 4), 255, np.uint8)
    image[..., :3] = rgb[..., ::-1]
    return image


def lidar_points(points: NDArray[np.float32], sensor: CarlaSensor) -> NDArray[np.float32]:
    """The rays that came back, from the ego's frame to the sensor's.

    Args:
        points: (rays, 4) x, y, z [m] in the ego's frame and intensity, zeros for the others.
        sensor: Its mounting.

    Returns:
        (N, 4), N at most the number of rays.
    """
    hits = points[points[:, 3] > 0.0].astype(np.float64)
    ahead, right = hits[:, 0] - sensor.x_m, hits[:, 1] - sensor.y_m
    c, s = math.cos(sensor.yaw_rad), math.sin(sensor.yaw_rad)
    turned = np.empty(hits.shape, np.float32)
    turned[:, 0] = c * ahead + s * right
    turned[:, 1] = c * right - s * ahead
    turned[:, 2] = hits[:, 2] - sensor.z_m
    turned[:, 3] = hits[:, 3]
    return turned


def gnss_at(
    gnss: NDArray[np.float64],
    imu: NDArray[np.float32],
    sensor: CarlaSensor,
    origin_latitude: float,
) -> NDArray[np.float64]:
    """A reading of the ego's origin, at the sensor's place: the compass says where that is."""
    yaw = float(imu[6]) - 0.5 * math.pi
    c, s = math.cos(yaw), math.sin(yaw)
    east_m = c * sensor.x_m - s * sensor.y_m
    south_m = s * sensor.x_m + c * sensor.y_m
    latitude, longitude, altitude = gnss.tolist()
    latitude, longitude = moved(latitude, longitude, east_m, south_m, origin_latitude)
    return np.array([latitude, longitude, altitude + sensor.z_m])


def imu_turned(imu: NDArray[np.float32], yaw_rad: float) -> NDArray[np.float64]:
    """Readings along the axes of an IMU that is turned to the right; level, so z stays."""
    turned = imu.astype(np.float64)
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    for first in (0, 3):
        ahead, right = turned[first], turned[first + 1]
        turned[first], turned[first + 1] = c * ahead + s * right, c * right - s * ahead
    turned[6] = (turned[6] + yaw_rad) % (2.0 * math.pi)
    return turned
