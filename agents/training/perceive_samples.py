"""Sequences of drives that eyes learn from, each a function of (seed, its number)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from torch.utils.data import Dataset

from agents.driveinsight.config import PolicyConfig
from agents.training.frames import RecordedDrive, read_drive
from agents.training.loading import town_of
from agents.training.moments import Moments as Chosen
from agents.training.perceive_config import PerceiveConfig
from agents.training.sequences import Moments, SequenceRenderer
from agents.training.variation import Variation
from di_envs.numerics.keyed_random import Stream, keyed_hash


class Sequences(Dataset[Moments]):
    """Sequences by their number over the whole training: step x batch + place in it.

    Numbers beyond the training's are those that it is measured on: unvaried but for weather, and
    the same each time.
    """

    def __init__(self, policy: PolicyConfig, training: PerceiveConfig, chosen: Chosen) -> None:
        self._policy, self._training, self._all = policy, training, chosen
        self._taught, kept_out = chosen.held_out(training.held_out)
        self._measured = kept_out.some(training.measured) if training.held_out else kept_out
        self._drives: dict[int, RecordedDrive] = {}
        self._renderers: dict[str, SequenceRenderer] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: what it is made from, without what it has read."""
        return _sequences, (self._policy.to_mapping(), self._training, self._all)

    def __len__(self) -> int:
        return self._training.steps * self._training.batch

    def __getitem__(self, number: int) -> Moments:
        training = self._training
        key = int(keyed_hash(training.seed, int(Stream.AGENT), number, 2)) % 2**62
        if number < len(self):
            return self._sequence(self._taught, key % len(self._taught), training.variation, key)
        unmoved = replace(training.variation, share=0.0)
        return self._sequence(self._measured, number - len(self), unmoved, key)

    def _sequence(self, chosen: Chosen, row: int, variation: Variation, key: int) -> Moments:
        number, last = int(chosen.drive[row]), int(chosen.moment[row])
        if number not in self._drives:
            self._drives[number] = read_drive(chosen.paths[number])
        drive = self._drives[number]
        length = self._training.length
        return self._renderer(drive).sequence(drive, last, length, variation, key)

    def _renderer(self, drive: RecordedDrive) -> SequenceRenderer:
        town = str(drive.facts["town"])
        if town not in self._renderers:
            depth = self._training.weights.depth > 0.0 and self._policy.camera is not None
            self._renderers[town] = SequenceRenderer(self._policy, *town_of(drive), depth=depth)
        return self._renderers[town]


def _sequences(policy: Mapping[str, Any], training: PerceiveConfig, chosen: Chosen) -> Sequences:
    return Sequences(PolicyConfig.from_mapping(policy), training, chosen)


def order(training: PerceiveConfig, first_step: int) -> Iterator[int]:
    """Numbers of sequences from a step on; after some steps, of those that are measured on."""
    size, total = training.batch, training.steps * training.batch
    for step in range(first_step, training.steps):
        yield from range(step * size, (step + 1) * size)
        if training.measured_after(step + 1):
            yield from range(total, total + training.measured_sequences)
