"""What a `RouteEnv` can be told: every option, its default, and which values are refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from typing_extensions import Self

from di_envs.files.names import LONGEST_NAME, name_hint
from di_envs.files.names import check_name as check_name  # from here, too
from di_envs.files.plain_text import one_plain_line
from di_envs.rules import RULES
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.sensors.geo_origin import checked_origin
from di_envs.sensors.lidar.config import SWEEP_S, LidarConfig, lidar_of
from di_envs.sensors.radar.config import FRONT_RADAR, RadarConfig, checked_radars
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import TICK_S

OBSERVATION_GROUPS = (
    "prompt",
    "inertial",
    "camera",
    "lidar",
    "odometry",
    "radar",
    "proximity",
)
# In place of a tuple of groups: the name of a preset, which chooses groups and the rig.
OBSERVATION_PRESETS: dict[str, dict[str, Any]] = {
    "rl": {"observations": ("prompt", "camera"), "cameras": "rl"}
}

# Forms of observations for learning libraries, see `di_envs.presets`.
PRESETS = ("box", "flat")

# Names of CARLA's presets (carla.WeatherParameters), the fourteen of the Leaderboard first.
WEATHERS = (
    "ClearNoon",
    "ClearSunset",
    "CloudyNoon",
    "CloudySunset",
    "WetNoon",
    "WetSunset",
    "MidRainyNoon",
    "MidRainSunset",
    "WetCloudyNoon",
    "WetCloudySunset",
    "HardRainNoon",
    "HardRainSunset",
    "SoftRainNoon",
    "SoftRainSunset",
    "ClearNight",
    "CloudyNight",
    "WetNight",
    "WetCloudyNight",
    "SoftRainNight",
    "MidRainyNight",
    "HardRainNight",
    "DustStorm",
    "Default",
)
ROUTE_WEATHER = "route"  # in place of one: what the route file says


class UnknownOptionError(TypeError, ValueError):
    """An option that there is not: a wrong value for us, and what Python calls a TypeError.

    Libraries that try an option of other environments, as TorchRL does `frameskip`, expect what
    Python says of an argument that a function lacks.
    """


@dataclass(frozen=True, kw_only=True)
class RouteEnvConfig:
    """Options of a `RouteEnv`. None stands for what the suite says.

    Either `suite` names a shipped suite, or `town` and `routes` name the user's own files; given
    together, the files replace the suite's town or routes and the suite gives the rest.

    Attributes:
        suite: Name of a shipped suite, such as `town05_long`.
        town: Name of a shipped town, or path of an OpenDRIVE file.
        routes: Path of a route file in CARLA's XML.
        route_ids: Ids of the routes to use; None for all.
        signals: Sidecar file or shipped name of a town's signals, or `synthesise`.
        scenarios: Name of a shipped trigger file, path of one in CARLA's JSON or of a folder of
            them, several with commas between, or `none`.
        observations: Groups of observations: `camera`, `lidar`, `prompt`, `inertial`, `odometry`,
            `radar`, `proximity`. Each camera
            costs its time, so name what is needed: `("prompt",)` alone steps many times faster.
            Or the name of a preset: `rl` is the prompt and the rig `rl`, one camera of 84 x 84.
        preset: In which form they come: `box`, every entry a Box; `flat`, one vector; None, as they
            are. See `di_envs.presets`.
        traffic: Number of other vehicles; without a suite that says it, by the length of lanes.
        walkers: Number of walkers; likewise.
        weather: Name of one of CARLA's weather presets, or `route`: what the route file says, which
            it is by default where the file says any. Seen by cameras only.
        cameras: Name of a rig, `small` (4 x 256 x 144), `driveinsight` (these, and one of 320 x 128
            that looks far ahead), `paper` (4 x 1600 x 900) or `rl` (one of 84 x 84), or a `Rig` of
            one's own; for the group `camera`.
        lidar: Name of a LiDAR, `paper` (32 x 175 rays), `leaderboard` (64 x 937) or `dense`
            (32 x 1800), or a `LidarConfig` of one's own; for the group `lidar`.
        radars: `RadarConfig`s with names of their own; for the group `radar`.
        gnss_origin: Latitude and longitude [deg] of x = y = 0, by which GNSS counts; None for what
            the town's map says.
        control_dt_s: Time for which an action is held, a multiple of the world tick of 0.05 s.
        rules: Name of the scoring rules; their penalties make the reward.
        terminate_on: Events that end the episode besides those by which the rules do, such as
            `collision_vehicle`.
        strict: Refuse a route file of which one route cannot be planned, rather than that route.
    """

    suite: str | None = None
    town: str | None = None
    routes: str | None = None
    route_ids: tuple[str, ...] | None = None
    signals: str | None = None
    scenarios: str | None = None
    observations: tuple[str, ...] = ("camera", "lidar", "prompt")
    preset: str | None = None
    traffic: int | None = None
    walkers: int | None = None
    weather: str | None = None
    cameras: str | Rig = "small"
    lidar: str | LidarConfig = "paper"
    radars: tuple[RadarConfig, ...] = FRONT_RADAR
    gnss_origin: tuple[float, float] | None = None
    control_dt_s: float = 0.1
    rules: str = "carla-1.0"
    terminate_on: tuple[str, ...] = ()
    strict: bool = False

    def __post_init__(self) -> None:
        self._expand_preset()
        self._freeze_names()
        if self.suite is None and (self.town is None or self.routes is None):
            raise ValueError(
                f"A RouteEnv needs suite=NAME, or both town=FILE and routes=FILE; got "
                f"suite={self.suite!r}, town={self.town!r}, routes={self.routes!r}."
            )
        self._check_names()
        if self.gnss_origin is not None:
            object.__setattr__(self, "gnss_origin", checked_origin(self.gnss_origin))
        for field in ("traffic", "walkers"):
            count = getattr(self, field)
            if count is not None and (isinstance(count, bool) or int(count) != count or count < 0):
                raise ValueError(f"{field} is a number of actors, 0 or more; got {count!r}.")
        ticks = self.control_dt_s / TICK_S
        if not (ticks >= 0.999 and abs(ticks - round(ticks)) < 1e-6):
            raise ValueError(
                f"control_dt_s must be a positive multiple of the world tick of {TICK_S} s, such "
                f"as 0.05, 0.1 or 0.5; got {self.control_dt_s!r}."
            )

    def _expand_preset(self) -> None:
        """Puts a preset's groups and rig in the place of its name."""
        if not isinstance(self.observations, str):
            return
        if self.observations in OBSERVATION_GROUPS:
            return  # refused below, with the tuple that was meant
        if self.observations in PRESETS:
            raise ValueError(
                f"observations says what is seen, preset in which form: "
                f"observations=('prompt',), preset={self.observations!r}."
            )
        check_name(self.observations, OBSERVATION_PRESETS, "preset of observations")
        preset = OBSERVATION_PRESETS[self.observations]
        default = type(self).cameras
        if self.cameras not in (default, preset["cameras"]):
            raise ValueError(
                f"The preset {self.observations!r} chooses the rig {preset['cameras']!r}; for "
                f"another one name its groups: observations={preset['observations']!r}."
            )
        for field, value in preset.items():
            object.__setattr__(self, field, value)

    def _freeze_names(self) -> None:
        """Makes tuples of lists (JSON has no tuples); a lone string is refused, not spelled out."""
        for field in ("route_ids", "observations", "terminate_on"):
            value = getattr(self, field)
            if isinstance(value, str):
                raise ValueError(f"{field} is a tuple of names; got a string. Try ({value!r},).")
            if value is not None:
                object.__setattr__(self, field, tuple(str(name) for name in value))

    def _check_names(self) -> None:
        if not self.observations:
            raise ValueError(f"observations is empty; known: {', '.join(OBSERVATION_GROUPS)}.")
        for group in self.observations:
            check_name(group, OBSERVATION_GROUPS, "observation group")
        if self.preset is not None:
            check_name(self.preset, PRESETS, "preset")
        if self.preset == "flat" and "camera" in self.observations:
            raise ValueError(
                "preset='flat' is one vector, which images do not go into: take preset='box', or "
                "observations without 'camera', such as ('prompt',)."
            )
        for event in self.terminate_on:
            check_name(event, EVENT_KEYS.values(), "event in terminate_on")
        if self.weather is not None:
            check_name(self.weather, (*WEATHERS, ROUTE_WEATHER), "weather")
        check_name(self.rules, RULES, "rules")
        rig_of(self.cameras)
        lidar_of(self.lidar)
        object.__setattr__(self, "radars", checked_radars(self.radars))

    @property
    def control_ticks(self) -> int:
        """World ticks for which an action is held."""
        return round(self.control_dt_s / TICK_S)

    @property
    def half_sweeps(self) -> bool:
        """Whether steps are so short that each sees half a turn of the LiDAR."""
        return self.control_ticks < round(SWEEP_S / TICK_S)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """A config of named options.

        Raises:
            UnknownOptionError: If an option is not known; with a suggestion.
            ValueError: If a value is refused.
        """
        known = [field.name for field in dataclasses.fields(cls)]
        for option in values:
            if option not in known:
                shown = one_plain_line(repr(option), LONGEST_NAME)
                raise UnknownOptionError(
                    f"RouteEnv got an unexpected keyword argument {shown}; "
                    f"{name_hint(option, known)}."
                )
        return cls(**values)

    def changes(self) -> dict[str, Any]:
        """The options that differ from their defaults, as keyword arguments."""
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if getattr(self, field.name) != field.default
        }
