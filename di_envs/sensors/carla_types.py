"""CARLA's names of sensors, how many of each the Leaderboard allows, and what each must say."""

from __future__ import annotations

from collections.abc import Mapping

from di_envs.files.text_enum import TextEnum


class SensorType(TextEnum):
    """The types that are simulated; with `STITCHED`, those of World on Rails' evaluator."""

    CAMERA = "sensor.camera.rgb"
    DEPTH = "sensor.camera.depth"
    SEMANTIC = "sensor.camera.semantic_segmentation"
    INSTANCE = "sensor.camera.instance_segmentation"
    STITCHED = "sensor.stitch_camera.rgb"
    STITCHED_SEMANTIC = "sensor.stitch_camera.semantic_segmentation"
    LIDAR = "sensor.lidar.ray_cast"
    SEMANTIC_LIDAR = "sensor.lidar.ray_cast_semantic"
    RADAR = "sensor.other.radar"
    GNSS = "sensor.other.gnss"
    IMU = "sensor.other.imu"
    COLLISION = "sensor.other.collision"
    COLLIDED = "sensor.collision"  # World on Rails': whether it ever has
    LANE_INVASION = "sensor.other.lane_invasion"
    OBSTACLE = "sensor.other.obstacle"
    SPEEDOMETER = "sensor.speedometer"
    MAP = "sensor.opendrive_map"


# CARLA's, or an evaluator's, but not simulated: whoever asks for one gets nothing from it
NOT_SIMULATED = (
    "sensor.camera.dvs",
    "sensor.camera.normals",
    "sensor.camera.optical_flow",
    "sensor.camera.cosmos_visualization",
    "sensor.other.rss",
    "sensor.other.v2x",
    "sensor.other.v2x_custom",
    "sensor.map",
)
_T = SensorType
STITCHED = (_T.STITCHED, _T.STITCHED_SEMANTIC)
IMAGES = (_T.CAMERA, _T.DEPTH, _T.SEMANTIC, _T.INSTANCE, *STITCHED)
LIDARS = (_T.LIDAR, _T.SEMANTIC_LIDAR)
EVENTS = (_T.COLLISION, _T.COLLIDED, _T.LANE_INVASION, _T.OBSTACLE)

_PLACE, _ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
_IMAGE = (*_PLACE, *_ANGLES, "width", "height", "fov")
# the numbers that CARLA's evaluators read of each, and refuse to go without
NUMBERS: Mapping[SensorType, tuple[str, ...]] = {
    **dict.fromkeys(IMAGES, _IMAGE),
    **dict.fromkeys(LIDARS, (*_PLACE, *_ANGLES)),
    _T.RADAR: (*_PLACE, *_ANGLES, "fov"),
    _T.GNSS: _PLACE,
    _T.IMU: (*_PLACE, *_ANGLES),
    **dict.fromkeys((*EVENTS, _T.SPEEDOMETER, _T.MAP), ()),
}

_ONE_EACH = {_T.GNSS: 1, _T.IMU: 1, _T.SPEEDOMETER: 1, _T.MAP: 1}
# What the Leaderboard itself allows: of 1.0 and the qualifiers of 2.x, and of 2.x
FEW: Mapping[SensorType, int] = {_T.CAMERA: 4, _T.LIDAR: 1, _T.RADAR: 2, **_ONE_EACH}
MANY: Mapping[SensorType, int] = {_T.CAMERA: 8, _T.LIDAR: 2, _T.RADAR: 4, **_ONE_EACH}
