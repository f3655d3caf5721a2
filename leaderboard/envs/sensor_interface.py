"""Where the data of an agent's sensors arrive, tick by tick, and from where it takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from di_envs.sensors.carla_sensor import SensorSuiteError as SensorConfigurationInvalid


class SensorInterface:
    """Holds the data of one tick. CARLA's waits for its server; here they are there already.

    Attributes:
        timestamp_s: Game time of the data.
    """

    def __init__(self) -> None:
        self.timestamp_s = 0.0
        self._data: Mapping[str, tuple[int, Any]] = {}

    def deliver(self, data: Mapping[str, tuple[int, Any]], timestamp_s: float) -> None:
        """Takes the data of a tick in place of the last one's."""
        self._data, self.timestamp_s = data, timestamp_s

    def get_data(self, frame: int | None = None) -> dict[str, tuple[int, Any]]:
        """By sensor id, the frame and its data. 2.x asks for a frame; there is one only."""
        return dict(self._data)


__all__ = ["SensorConfigurationInvalid", "SensorInterface"]
