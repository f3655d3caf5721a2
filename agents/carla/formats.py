"""Observations in the formats in which the CARLA Leaderboard hands them to an agent.

Every tick an agent gets `{sensor id: (frame, data)}`. Data are: of a camera (H, W, 4) uint8 in the
order blue, green, red, alpha; of the LiDAR (N, 4) float32 x, y, z [m] in the sensor's own frame (x
ahead, y right, z up, turned with its mounting) and intensity, of the rays that came back in this
tick; of GNSS latitude [deg], longitude [deg], altitude [m]; of the IMU accelerations [m/s2],
angular rates [rad/s] and the compass [rad, clockwise from north], seven float64; of the
speedometer `{"speed": m/s}`, once more under `spd`, as World on Rails reads it; of the map
`{"opendrive": text}`; of a radar (N, 4) float32 distance [m], elevation, azimuth to the right
[rad] and speed away [m/s]. For sensors of events see `agents.carla.events`, for cameras that see
no colours `agents.carla.images`, for semantic LiDARs `semantic_points`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.carla.events import EventMemory, events_of
from agents.carla.images import bgra, depth_image, empty_image, instance_image, semantic_image
from agents.carla.plan import moved
from agents.carla.tags import tags_of_version
from di_envs.sensors.carla_sensor import CarlaSensor, SensorSuiteError
from di_envs.sensors.carla_suite import CarlaSuite
from di_envs.sensors.carla_types import EVENTS, IMAGES, LIDARS, STITCHED, SensorType

InputData = dict[str, tuple[int, Any]]
SEMANTIC_POINT = np.dtype(
    [("x", "f4"), ("y", "f4"), ("z", "f4"), ("CosAngle", "f4"), ("ObjIdx", "u4"), ("ObjTag", "u4")]
)


def input_data(
    suite: CarlaSuite,
    observation: Mapping[str, Any],
    frame: int,
    origin: tuple[float, float],
    before: EventMemory = EventMemory(),  # noqa: B008 (a frozen value)
) -> InputData:
    """What the sensors of a suite say, of one observation.

    Args:
        suite: The sensors.
        observation: Of an environment made with the suite's `observations` and `options`; with the
            `Town` under `town` where the suite has a map.
        frame: Number of the tick.
        origin: Latitude and longitude [deg] of x = y = 0, by which GNSS counts.
        before: What the sensors of events remember of the tick before.

    Raises:
        SensorSuiteError: If the observation is of an environment with other sensors.
    """
    data: InputData = {}
    for sensor in suite.sensors:
        if sensor.empty:
            found = _empty(sensor)
        elif sensor.type in EVENTS:
            found = events_of(sensor, observation, before, frame)
        else:
            found = _data(sensor, observation, origin, suite.leaderboard)
        data[sensor.id] = (frame, found)
    return data


def _data(
    sensor: CarlaSensor,
    observation: Mapping[str, Any],
    origin: tuple[float, float],
    leaderboard: str,
) -> Any:
    try:
        if sensor.type in IMAGES:
            return _image(sensor, observation, leaderboard)
        match sensor.type:
            case SensorType.LIDAR:
                return lidar_points(observation["lidar"], sensor)
            case SensorType.SEMANTIC_LIDAR:
                return semantic_points(observation, sensor, leaderboard)
            case SensorType.RADAR:
                assert sensor.radar is not None
                return radar_points(observation[sensor.radar.name])
            case SensorType.GNSS:
                return gnss_at(observation["gnss"], observation["imu"], sensor, origin[0])
            case SensorType.IMU:
                return imu_turned(observation["imu"], sensor.yaw_rad)
            case SensorType.SPEEDOMETER:
                speed_mps = float(observation["speed"][0])
                return {"speed": speed_mps, "spd": speed_mps}
            case _:
                return {"opendrive": with_origin(observation["town"].opendrive, origin)}
    except KeyError as error:
        raise SensorSuiteError(
            f"Sensor '{sensor.id}': the environment was made without {error}. An agent's sensors() "
            f"are asked for once, before the first route; they must be the same for every route."
        ) from error


def _image(
    sensor: CarlaSensor, observation: Mapping[str, Any], leaderboard: str
) -> NDArray[np.uint8]:
    """What a sensor of images sees."""
    images = []
    for camera in sensor.cameras:
        name = camera.name
        match sensor.type:
            case SensorType.DEPTH:
                images.append(depth_image(observation[f"{name}_depth"]))
            case SensorType.SEMANTIC | SensorType.STITCHED_SEMANTIC:
                tags = tags_of_version(observation[f"{name}_semantic"], leaderboard)
                images.append(semantic_image(tags))
            case SensorType.INSTANCE:
                tags = tags_of_version(observation[f"{name}_semantic"], leaderboard)
                images.append(instance_image(tags, observation[f"{name}_instance"]))
            case _:
                images.append(bgra(observation[name]))
    return _joined(sensor, images)


def _joined(sensor: CarlaSensor, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The image of a camera, or those of a stitched one side by side, colours or tags alone."""
    if sensor.type not in STITCHED:
        return images[0]
    row = np.concatenate(images, axis=1)
    return row[..., 2] if sensor.type == SensorType.STITCHED_SEMANTIC else row[..., :3]


def _empty(sensor: CarlaSensor) -> Any:
    """What a sensor that cannot see says: its format, with nothing in it."""
    if sensor.type in IMAGES:
        return _joined(sensor, [empty_image(camera) for camera in sensor.cameras])
    if sensor.type == SensorType.SEMANTIC_LIDAR:
        return np.zeros(0, SEMANTIC_POINT)
    if sensor.type == SensorType.IMU:
        return np.zeros(7)
    if sensor.type in LIDARS or sensor.type == SensorType.RADAR:
        return np.zeros((0, 4), np.float32)
    return np.zeros(0, np.float32)


def radar_points(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 4) distance, elevation, azimuth, speed away: the order in which the Leaderboard, which
    turns CARLA's rows round, hands them on; of the rays that met something."""
    return rows[rows[:, 0] > 0.0][:, [0, 2, 1, 3]]


@lru_cache(maxsize=4)
def with_origin(opendrive: str, origin: tuple[float, float]) -> str:
    """A map's text with another origin of its geoReference, so that it agrees with GNSS.

    One that agrees already stays as it is, letter by letter.
    """

    def moved_origin(found: re.Match[str]) -> str:
        text = found[0]
        for key, value in zip(("lat_0", "lon_0"), origin, strict=True):
            text = re.sub(rf"{key}=([-+.\deE]+)", partial(_kept_or_put, key, value), text)
        return text

    return re.sub(r"<geoReference>.*?</geoReference>", moved_origin, opendrive, flags=re.DOTALL)


def _kept_or_put(key: str, value: float, found: re.Match[str]) -> str:
    return found[0] if float(found[1]) == value else f"{key}={value!r}"


def semantic_points(
    observation: Mapping[str, Any], sensor: CarlaSensor, leaderboard: str
) -> NDArray[np.void]:
    """(N,) `SEMANTIC_POINT`: place in the sensor's frame, angle, actor's id, tag."""
    hit = observation["lidar"][:, 3] > 0.0
    places = lidar_points(observation["lidar"], sensor)
    points = np.zeros(len(places), SEMANTIC_POINT)
    points["x"], points["y"], points["z"] = places[:, :3].T
    points["CosAngle"] = observation["lidar_incidence"][hit]
    points["ObjIdx"] = observation["lidar_instance"][hit]
    points["ObjTag"] = tags_of_version(observation["lidar_semantic"][hit], leaderboard)
    return points


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
