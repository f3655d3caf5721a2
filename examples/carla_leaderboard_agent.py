"""An agent for the CARLA Leaderboard, written from its documentation: one file, both simulators.

It sees two cameras, a LiDAR, GNSS, an IMU and a speedometer, finds its place by GNSS, compass and
speed, follows the sparse route by a PID controller, keeps its distance from what the LiDAR shows on
its way, stops at lights that its cameras show red, and at junctions without lights. Here:

    driveinsight evaluate --agent carla:examples/carla_leaderboard_agent.py --suite town05_short

In CARLA the same file goes to the Leaderboard's `--agent`. It needs NumPy; where the `carla` wheel
is installed it returns `carla.VehicleControl`s.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

try:
    from carla import VehicleControl
except ImportError:  # no simulator of CARLA's: any object with these fields will do

    def VehicleControl():  # noqa: N802 (CARLA's name)
        return SimpleNamespace(throttle=0.0, steer=0.0, brake=0.0, hand_brake=False, reverse=False)


TICK_S = 0.05
EARTH_M = 6378137.0
REAR_M = 1.4  # from the car's middle back to its rear axle, where GNSS is mounted
NOSE_M = 2.5  # … and ahead to its bumper
CRUISE_MPS = 7.0
SIDEWAYS_MPS2 = 2.0  # comfortable in turns
BRAKING_MPS2 = 2.5  # what it plans with
GAP_M = 3.0  # to what stands ahead
STOP_M = 3.0  # before a junction, so that its cameras still see the light beside the line
HALF_LANE_M = 1.45  # what comes nearer to its way than this is on it
LOOK_M = 25.0
CHANGE_M = 12.0  # a lane change goes on so far behind its points
LEFT, RIGHT, STRAIGHT = 1, 2, 3  # values of CARLA's RoadOption
CHANGES = (5, 6)
CAMERAS = {"front": (0.0, 640, 360, 70.0), "right": (50.0, 480, 360, 70.0)}  # yaw, size, FOV
CAMERA_X_M, CAMERA_Z_M, LIDAR_Z_M = 1.3, 2.3, 2.5


def get_entry_point():
    """The Leaderboard asks for the name of the class."""
    return "RouteFollower"


class RouteFollower(AutonomousAgent):
    """Drives the route that it is given, among others, by the lights."""

    def setup(self, path_to_conf_file):
        """There are no weights to load."""
        self.track = Track.SENSORS
        self.way = None
        self.place = None  # of the rear axle: metres east and south of the route's first point
        self.fixes = 100.0  # GNSS fixes that the present place is worth: it begins on the route
        self.speed = 0.0
        self.yaw = 0.0
        self.station = 0  # index on the way
        self.points = []  # of the last two half sweeps
        self.bearings = (0.0, 0.0)  # present error of the steering PID, and its mean
        self.passed = set()  # junctions at which it has stopped, or seen green

    def sensors(self):
        """Two cameras, LiDAR, GNSS, IMU, speedometer: metres and degrees in the car's frame."""
        level = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
        mast = {"x": CAMERA_X_M, "y": 0.0, "z": CAMERA_Z_M, **level}
        cameras = [
            {"type": "sensor.camera.rgb", "id": name, **mast, "yaw": yaw, "width": w, "height": h}
            | {"fov": fov}
            for name, (yaw, w, h, fov) in CAMERAS.items()
        ]
        return [
            *cameras,
            {"type": "sensor.lidar.ray_cast", "id": "lidar", "x": 0.0, "y": 0.0, "z": LIDAR_Z_M}
            | level,
            {"type": "sensor.other.gnss", "id": "gps", "x": -REAR_M, "y": 0.0, "z": 0.0},
            {"type": "sensor.other.imu", "id": "imu", "x": 0.0, "y": 0.0, "z": 0.0, **level},
            {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20},
        ]

    def run_step(self, input_data, timestamp):
        """Where am I, what is in the way, how fast, which way."""
        if self.way is None:
            self.way = Way(self._global_plan, self._global_plan_world_coord)
        self.localise(input_data)
        limits = [self.way.speed_limit(self.station)]
        limits.append(speed_before(self.free_metres(input_data["lidar"][1]) - GAP_M))
        limits.append(self.junction_speed(input_data))
        return self.control(min(limits))

    def localise(self, data):
        """Dead reckoning by speed and compass, corrected by GNSS as its noise deserves."""
        speed = data["speed"][1]["speed"]
        yaw = facing(data)
        east, south = self.way.metres(*data["gps"][1][:2])
        if self.place is None:
            self.place = self.way.points[0] - REAR_M * unit(yaw)
            self.yaw, self.speed = yaw, speed
        self.place = self.place + 0.5 * (self.speed + speed) * TICK_S * unit(0.5 * (self.yaw + yaw))
        self.fixes = min(self.fixes + 1.0, 150.0)
        self.place = self.place + (np.array([east, south]) - self.place) / self.fixes
        self.speed, self.yaw = speed, yaw
        ahead = self.way.points[self.station : self.station + 40]
        middle = self.place + REAR_M * unit(yaw)
        self.station += int(np.argmin(np.hypot(*(ahead - middle).T)))

    def in_car(self, points):
        """(N, 2) points of the way, ahead and to the right of the car's middle."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        away = points - (self.place + REAR_M * unit(self.yaw))
        return np.stack([c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0]], axis=1)

    def free_metres(self, sweep):
        """Metres of the way ahead of the bumper that the LiDAR shows free."""
        height = sweep[:, 2] + LIDAR_Z_M
        solid = sweep[(height > 0.4) & (height < 2.2) & (np.abs(sweep[:, 1]) < 20.0)][:, :2]
        self.points = [*self.points[-1:], solid[np.hypot(*solid.T) < LOOK_M + 5.0]]
        points = np.concatenate(self.points)
        ahead = self.in_car(self.way.points[self.station : self.station + int(2 * LOOK_M)])
        if not len(points) or not len(ahead):
            return LOOK_M
        away = np.hypot(*(points[:, None] - ahead[None]).transpose(2, 0, 1))
        hit = (away < HALF_LANE_M) & (points[:, 0] > NOSE_M)[:, None]
        first = np.argmax(hit.any(axis=0)) * Way.STEP_M if hit.any() else LOOK_M
        return first - NOSE_M + 0.5 * HALF_LANE_M if hit.any() else LOOK_M

    def junction_speed(self, data):
        """What the next junction allows: nothing at red, a full stop where there is no light."""
        junction = next((j for j in self.way.junctions if j >= self.station), None)
        if junction is None:
            return CRUISE_MPS
        metres = (junction - self.station) * Way.STEP_M - NOSE_M
        if metres > LOOK_M or metres < -1.0:
            return CRUISE_MPS
        if metres < STOP_M and junction in self.passed:
            return CRUISE_MPS  # the lamp beside the line is out of sight by now
        light = self.light(data, *self.in_car(self.way.points[junction : junction + 1])[0])
        if light == "green":
            self.passed.add(junction)
            return CRUISE_MPS
        if light in ("red", "yellow"):
            self.passed.discard(junction)
            needed = self.speed**2 / 2.0 / max(metres, 0.1)
            return (
                CRUISE_MPS if light == "yellow" and needed > 4.0 else speed_before(metres - STOP_M)
            )
        if junction in self.passed:
            return CRUISE_MPS
        if self.speed < 0.05 and metres < STOP_M + 2.0:
            self.passed.add(junction)
        return speed_before(metres - STOP_M + 1.0)

    def light(self, data, ahead, right):
        """The colour of the light beside the stop line, or of the one beyond the junction."""
        near = [(ahead + a, right + r, z) for a in (-1, 2) for r in (2, 10) for z in (2.8, 4.1)]
        far = [(ahead + a, right + r, z) for a in (14, 40) for r in (-3, 3) for z in (5.0, 6.3)]
        for corners, least in ((near, 12), (far, 3)):
            counts = {"red": 0, "yellow": 0, "green": 0}
            for name, (yaw, width, height, fov) in CAMERAS.items():
                window = seen_at(corners, yaw, width, height, fov)
                if window is not None:
                    for colour, count in lamps(data[name][1][window]).items():
                        counts[colour] = max(counts[colour], count)
            colour = max(counts, key=counts.get)
            if counts[colour] >= least:
                return colour
        return None

    def control(self, speed):
        """PID controllers: of steering on the bearing of a point ahead, of pedals on speed."""
        aim = min(
            self.station + int((3.0 + 0.35 * self.speed) / Way.STEP_M), len(self.way.points) - 1
        )
        ahead, right = self.in_car(self.way.points[aim : aim + 1])[0]
        bearing = math.atan2(right, ahead + REAR_M)
        before, mean = self.bearings
        mean = 0.95 * mean + 0.05 * bearing
        self.bearings = (bearing, mean)
        control = VehicleControl()
        steer = 1.35 * bearing + 0.1 * mean + 0.1 * (bearing - before) / TICK_S
        control.steer = float(np.clip(steer, -1.0, 1.0))
        error = speed - self.speed
        if speed < 0.1 or error < -0.4:
            control.brake = float(np.clip(-0.35 * error, 0.0, 1.0)) if speed >= 0.1 else 0.8
        else:
            control.throttle = float(np.clip(0.32 + 0.25 * error, 0.0, 0.75))
        return control


class Way:
    """A smooth line through the sparse points of a route, from their GPS coordinates.

    The transforms that come with them say which way the road points there.
    """

    STEP_M = 0.5

    def __init__(self, gps, transforms):
        self.latitude, self.longitude = gps[0][0]["lat"], gps[0][0]["lon"]
        nodes = [np.array(self.metres(point["lat"], point["lon"])) for point, _ in gps]
        headings = [unit(math.radians(place.rotation.yaw)) for place, _ in transforms]
        options = [int(getattr(option, "value", option)) for _, option in gps]
        nodes, headings, options = widened_changes(nodes, headings, options)
        self.points, starts = smooth(nodes, headings, self.STEP_M)
        crossing = (LEFT, RIGHT, STRAIGHT)
        self.junctions = [s for s, o in zip(starts, options, strict=False) if o in crossing]
        turn = np.gradient(np.unwrap(np.arctan2(*np.gradient(self.points, axis=0).T[::-1])))
        limit = np.sqrt(SIDEWAYS_MPS2 / np.maximum(np.abs(turn) / self.STEP_M, 1e-3))
        self.limit = np.minimum(limit, CRUISE_MPS)

    def metres(self, latitude, longitude):
        """East and south of the route's first point."""
        east = math.radians(longitude - self.longitude) * math.cos(math.radians(self.latitude))
        return EARTH_M * east, -EARTH_M * math.radians(latitude - self.latitude)

    def speed_limit(self, station):
        """The speed from which every bend ahead can still be taken as it should be."""
        ahead = self.limit[station : station + int(LOOK_M / self.STEP_M)]
        braking = 2.0 * BRAKING_MPS2 * self.STEP_M * np.arange(len(ahead))
        return float(np.sqrt(ahead**2 + braking).min()) if len(ahead) else CRUISE_MPS


def widened_changes(nodes, headings, options):
    """The points of a lane change lie a few metres apart; a car takes it over some twenty."""
    kept = []
    for i, (node, heading, option) in enumerate(zip(nodes, headings, options, strict=True)):
        if option in CHANGES and i > 0 and options[i - 1] in CHANGES:
            if i + 1 < len(nodes) and options[i + 1] in CHANGES:
                continue  # one of several lanes
            after = nodes[i + 1] - node if i + 1 < len(nodes) else 2.0 * CHANGE_M * heading
            node = node + after * min(CHANGE_M / np.hypot(*after), 0.5)
        kept.append((node, heading, option))
    return tuple(zip(*kept, strict=True))


def smooth(nodes, headings, step):
    """Cubics from node to node, and straight on past the end."""
    pieces, starts = [], []
    for i in range(len(nodes) - 1):
        starts.append(sum(map(len, pieces)))
        far = np.hypot(*(nodes[i + 1] - nodes[i]))
        t = np.linspace(0.0, 1.0, max(round(far / step), 1), endpoint=False)[:, None]
        pieces.append(
            (1 + 2 * t) * (1 - t) ** 2 * nodes[i]
            + t * (1 - t) ** 2 * far * headings[i]
            + t * t * (3 - 2 * t) * nodes[i + 1]
            - t * t * (1 - t) * far * headings[i + 1]
        )
    beyond = nodes[-1] + np.arange(0.0, 30.0, step)[:, None] * headings[-1]
    return even(np.concatenate([*pieces, beyond]), starts, step)


def even(points, starts, step):
    """The same line in even steps, and where on it those indices come to lie."""
    metres = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    stations = np.arange(0.0, metres[-1], step)
    line = np.stack([np.interp(stations, metres, points[:, axis]) for axis in (0, 1)], axis=1)
    return line, [round(metres[start] / step) for start in starts]


def seen_at(corners, yaw, width, height, fov):
    """The part of an image where a box in the car's frame is seen; None where it is not."""
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    focal = width / 2.0 / math.tan(math.radians(fov) / 2.0)
    x, y, z = np.array(corners).T
    x = x - CAMERA_X_M
    depth, aside = c * x + s * y, c * y - s * x
    if depth.max() < 1.0:
        return None
    depth = np.maximum(depth, 1.0)
    columns = width / 2.0 + focal * aside / depth
    rows = height / 2.0 - focal * (z - CAMERA_Z_M) / depth
    left, right = np.clip([columns.min(), columns.max() + 1.0], 0, width).astype(int)
    top, bottom = np.clip([rows.min(), rows.max() + 1.0], 0, height).astype(int)
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def lamps(image):
    """Pixels of lit lamps, by colour: images come as blue, green, red, alpha."""
    blue, green, red = (image[..., k].astype(int) for k in range(3))
    return {
        "red": int(((red > 200) & (green < 90) & (blue < 90)).sum()),
        "yellow": int(((red > 200) & (green > 130) & (blue < 90)).sum()),
        "green": int(((green > 180) & (red < 110)).sum()),
    }


def speed_before(metres):
    """The speed from which it still stops within so many metres."""
    return math.sqrt(2.0 * BRAKING_MPS2 * max(metres, 0.0))


def facing(data):
    """The car's yaw: from east, clockwise. The compass counts from north."""
    return data["imu"][1][6] - math.pi / 2.0


def unit(angle):
    """(2,) the direction of an angle from east, clockwise."""
    return np.array([math.cos(angle), math.sin(angle)])
