"""The sizes of `mile`."""

from __future__ import annotations

from dataclasses import dataclass

from agents.networks.sizes import check_sizes
from agents.zoo.system import SystemConfig


@dataclass(frozen=True, kw_only=True)
class MileConfig(SystemConfig):
    """What it sees, and the sizes of its network.

    Attributes:
        token: Width of what encodes the route, and the speed.
        seen: Width of what a moment shows.
        memory: Of the part of the state that is certain.
        latent: Of the part that is drawn.
        width: Of the policy.
        speed_noise_mps: Deviation of what training adds to the speed.
        blind: Share of the moments of training at which it goes on without looking.
        route_spoilt: Share at which the route is dropped; as many at which it ends, or is turned.
    """

    system: str = "mile"
    cameras: tuple[str, ...] = ("camera_front", "camera_front_narrow")
    told: tuple[str, ...] = ("routing", "speed")
    past: int = 5
    labels: tuple[str, ...] = ("action", "semantics")
    token: int = 16
    seen: int = 128
    memory: int = 192
    latent: int = 64
    width: int = 128
    speed_noise_mps: float = 1.4
    blind: float = 0.15
    route_spoilt: float = 0.025

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes(self, "token", "seen", "memory", "latent", "width")
        for name in ("blind", "route_spoilt"):
            if not 0.0 <= getattr(self, name) <= 0.3:
                raise ValueError(f"{name} must be from 0 to 0.3, not {getattr(self, name)}")


CONFIGS = {"mile": MileConfig()}
