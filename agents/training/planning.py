"""Batches for a planner from moments that are encoded: the ego set aside, the eyes a little off.

To set the ego aside moves every row of the prompt, of what is seen, and of the waypoints: nothing
is rendered. Which moments make a batch, and all that varies in it, is a function of (seed, step).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import Self

from agents.driveinsight.config import TOKENS, PolicyConfig
from agents.driveinsight.losses import Targets
from agents.driveinsight.model import Inputs
from agents.driveinsight.seen import Seen
from agents.training.caching import MomentCache
from agents.training.config import TrainConfig
from agents.training.distributed import ALONE, Team
from agents.training.emphasis import Emphasis, cumulated, meant
from agents.training.moments import spread
from agents.training.own_eyes import OwnEyes
from agents.training.samples import Batch
from agents.training.seen_noise import NO_NOISE, EyeConfig, seen_through
from agents.training.standing import stands_for
from agents.training.told_speeds import told_speeds
from agents.training.turned_red import told_red, turned_red
from agents.training.variation import Variation
from agents.training.waiting import among_others, of_the_one_before
from di_envs.numerics.keyed_arrays import keyed_uniforms, stream_of
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.prompt import POSITION_LIMIT_M

_ROWS, _ASIDE = stream_of("moments of a batch"), stream_of("moments set aside")


@dataclass(frozen=True)
class _Feigned:
    """What of a batch is told otherwise than it was.

    Attributes:
        speeds: Share of samples that are told wrong ones; see `told_speeds`.
        red: Share of samples before a green light that are told it is red; see `turned_red`.
        others: Share of those that wait at a red one that wait among others; see `among_others`.
    """

    speeds: float = 0.0
    red: float = 0.0
    others: float = 0.0

    @classmethod
    def of(cls, training: TrainConfig) -> Self:
        """As a training has it."""
        return cls(training.mistold, training.turned_red, training.among_others)


_NOTHING = _Feigned()


@dataclass(frozen=True, kw_only=True)
class PlanningSamples:
    """The batches of a planner's training, by step.

    Attributes:
        policy: That is trained.
        training: The whole of it.
        cache: Where moments come from.
        taught: Rows of the cache that are learnt from.
        kept_out: Rows that are measured on, in their order.
        valid: (M, T) which waypoints of the cache are learnt; see `foreseen`.
        drawn: (T,) how often each of these and all before it are drawn together, up to 1.
        own: What the policy's own eyes have seen at these moments; None where none has looked.
    """

    policy: PolicyConfig
    training: TrainConfig
    cache: MomentCache
    taught: NDArray[np.int64]
    kept_out: NDArray[np.int64]
    valid: NDArray[np.bool_]
    drawn: NDArray[np.float64]
    own: OwnEyes | None = None

    @classmethod
    def of(
        cls,
        policy: PolicyConfig,
        training: TrainConfig,
        cache: MomentCache,
        own: OwnEyes | None = None,
    ) -> PlanningSamples:
        """Keeps some drives out, as `Moments.held_out` does."""
        taught, kept_out = cache.moments.held_out_rows(training.held_out)
        if training.overfit:
            taught = spread(taught, training.overfit)
        emphasis = Emphasis.of(cache.rows, training.interest)
        return cls(
            policy=policy,
            training=training,
            cache=cache,
            taught=taught,
            kept_out=spread(kept_out, training.measured),
            valid=emphasis.known & (cache.rows["valid"] > 0),
            drawn=cumulated(emphasis.weights[taught]),
            own=own,
        )

    def batch(self, step: int, share: slice) -> Batch:
        """What is learnt from in a step; of it a part."""
        training = self.training
        key = int(keyed_hash(training.seed, int(Stream.AGENT), step, 2)) % 2**62
        drawn = keyed_uniforms(key, _ROWS, 0, (training.batch,))
        rows = self.taught[meant(self.drawn, drawn)]
        right_m, turn_rad = set_aside(training.varied, training.batch, key)
        eyes = NO_NOISE if training.overfit else training.eyes
        feigned = _NOTHING if training.overfit else _Feigned.of(training)
        return self._batch(rows, right_m, turn_rad, eyes, key, share, feigned)

    def measured(self, number: int, share: slice) -> Batch:
        """The moments that it is measured on, one batch after the other: nothing is varied."""
        size = self.training.batch
        rows, still = self.kept_out[number * size : (number + 1) * size], np.zeros(size)
        return self._batch(rows, still, still, NO_NOISE, 0, share)

    def batches(self, first_step: int, team: Team = ALONE) -> Generator[Batch, None, None]:
        """Batches from a step on, and after some steps those that are measured on."""
        training = self.training
        share = team.share(training.batch)
        for step in range(first_step, training.steps):
            yield self.batch(step, share)
            if training.measured_after(step + 1):
                for number in range(training.measured // training.batch):
                    yield self.measured(number, share)

    def _batch(
        self,
        rows: NDArray[np.int64],
        right_m: NDArray[np.float64],
        turn_rad: NDArray[np.float64],
        eyes: EyeConfig,
        key: int,
        share: slice,
        feigned: _Feigned = _NOTHING,
    ) -> Batch:
        moments, valid = self.cache.rows[rows], self.valid[rows]
        red = turned_red(moments, valid, feigned.red, key)
        waits = among_others(moments, valid, feigned.others, key)
        moved = _Moved(right_m, turn_rad)
        objects = moved.rows(_whole(moments["objects"]), velocity=True)
        signals = moved.rows(_whole(moments["signals"]))
        objects, signals = seen_through(eyes, self.policy.grid, objects, signals, key)
        if self.own is not None:
            seen, looked = self.own.rows[rows], self.own.looked[rows, None, None]
            own = moved.rows(_whole(seen["objects"]), velocity=True)
            objects = np.where(looked, own, objects)
            own = moved.rows(_whole(told_red(seen["signals"], red)))
            signals = np.where(looked, own, signals)
        objects = of_the_one_before(objects, waits)
        prompt = _prompt(moments, moved) | told_speeds(moments, feigned.speeds, key)
        inputs = Inputs(
            prompt={name: _tensor(value[share]) for name, value in prompt.items()},
            present=torch.ones(share.stop - share.start, len(TOKENS)),
            seen=Seen(objects=_tensor(objects[share]), signals=_tensor(signals[share])),
        )
        waypoints = moved.places(moments["waypoints"]) * valid[..., None]
        targets = Targets(
            waypoints=_tensor(waypoints[share]),
            valid=_tensor(_whole(valid[share])),
            stands_for=_tensor(stands_for(moments, valid)[share].astype(np.float32)),
        )
        return Batch(
            inputs=(inputs,), targets=targets, begun=torch.ones(1, share.stop - share.start)
        )


def set_aside(
    variation: Variation, batch: int, key: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(B,) how far each sample's ego stands to the right [m], and is turned to the right [rad]."""
    draws = keyed_uniforms(key, _ASIDE, 0, (batch, 3))
    varied = draws[:, 0] < variation.share
    aside, turn = (2.0 * draws[:, n] - 1.0 for n in (1, 2))
    return varied * aside * variation.aside_m, varied * turn * variation.turn_rad


class _Moved:
    """Rows in the ego frame, as they are once the ego stands elsewhere.

    Args:
        right_m: (B,) how far it stands to the right.
        turn_rad: (B,) how far it is turned to the right.
    """

    def __init__(self, right_m: NDArray[np.float64], turn_rad: NDArray[np.float64]) -> None:
        self._right, self._turn = right_m.astype(np.float32), turn_rad.astype(np.float32)
        self._cos, self._sin = np.cos(self._turn), np.sin(self._turn)

    def places(self, places: NDArray[np.float32]) -> NDArray[np.float32]:
        """(B, ..., 2) x, y [m], clipped as the prompt's are."""
        x, y = places[..., 0], places[..., 1] - _beside(self._right, places[..., 1])
        moved = self._turned(x, y)
        return np.clip(moved, -POSITION_LIMIT_M, POSITION_LIMIT_M)

    def rows(self, rows: NDArray[np.float32], *, velocity: bool = False) -> NDArray[np.float32]:
        """(B, K, F) x, y, yaw, …, presence; zeros where there is none."""
        out = rows.copy()
        out[..., :2] = self.places(rows[..., :2])
        yaw = rows[..., 2] - self._turn[:, None]
        out[..., 2] = np.arctan2(np.sin(yaw), np.cos(yaw))
        if velocity:
            out[..., 5:7] = self._turned(rows[..., 5], rows[..., 6])
        return out * (rows[..., -1:] > 0.0)

    def _turned(self, x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
        cos, sin = _beside(self._cos, x), _beside(self._sin, x)
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def _beside(values: NDArray[np.float32], rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """(B,) values with as many axes as the rows (B, ...)."""
    return values.reshape(-1, *(1,) * (rows.ndim - 1))


def _prompt(moments: NDArray[np.void], moved: _Moved) -> dict[str, NDArray[Any]]:
    """The prompt's components but the speeds, as an observation has them, (B, ...) each."""
    kinds = moments["map_kinds"][..., None].astype(np.float32)
    there = (kinds > 0.0).astype(np.float32)
    places = moved.places(_whole(moments["map_places"])) * there
    target = np.concatenate(
        [moments["target_point"], np.ones((len(moments), 1), np.float32)], axis=1
    )
    return {
        "command": moments["command"].astype(np.int64)[:, None],
        "target_point": moved.rows(target[:, None])[:, 0, :3],
        "routing": moved.rows(_whole(moments["routing"])),
        "map": np.concatenate([places, kinds, there], axis=-1),
        "obstacles": moved.rows(_whole(moments["obstacles"]), velocity=True),
        "traffic_lights": moved.rows(_whole(moments["traffic_lights"])),
        "stop_signs": moved.rows(_whole(moments["stop_signs"])),
    }


def _whole(values: NDArray[Any]) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _tensor(values: NDArray[Any]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values))
