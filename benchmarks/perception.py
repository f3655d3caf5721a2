"""How well a policy's eyes see on drives that it has not learnt from, and what looking costs.

    driveinsight collect --frames 4000 --first 5000 --output fresh
    python benchmarks/perception.py runs/driveinsight/policy fresh

Prints a row for each town and one for all: the figures of `agents.training.perception_metrics`, at
moments that remember all that they can, in weathers of their own. Then milliseconds of the
processor for one decision's seeing, part by part.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path

import torch

from agents.driveinsight.model import Policy
from agents.driveinsight.perception import Encoded, Perception
from agents.driveinsight.reading import read_seen
from agents.driveinsight.weights import from_pretrained
from agents.networks.fused import fuse_norms
from agents.training.frames import read_drive
from agents.training.loading import town_of
from agents.training.moments import load_moments
from agents.training.perceiving import look, moments_of
from agents.training.perception_metrics import FIGURES, figures, perception_sums
from agents.training.sequences import Moments, SequenceRenderer
from agents.training.variation import Variation

LOOKS = 15  # whose median is told


def measured(policy: Policy, folder: Path, sequences: int) -> dict[str, Counter[str]]:
    """Sums by town, over so many moments spread evenly over all drives."""
    perception = policy.perception
    assert perception is not None
    length = policy.config.memory_frames + 1
    chosen = load_moments([folder], 0.2).some(sequences)
    weathers = Variation(share=0.0)
    renderers = dict[str, SequenceRenderer]()
    sums = dict[str, Counter[str]]()
    for row, (number, last) in enumerate(zip(chosen.drive, chosen.moment, strict=True)):
        drive = read_drive(chosen.paths[number])
        town = str(drive.facts["town"])
        if town not in renderers:
            renderers[town] = SequenceRenderer(policy.config, *town_of(drive), depth=False)
        moments = renderers[town].sequence(drive, int(last), length, weathers, row)
        with torch.inference_mode():
            heads, _ = look(perception, moments, length)
        newest = torch.arange(length) == length - 1
        found = perception_sums(
            moments_of(heads, newest), moments_of(moments.targets, newest), policy.config.grid
        )
        sums.setdefault(town, Counter()).update(found)
    return sums


def print_table(sums: dict[str, Counter[str]]) -> None:
    """A column for each town and one for all, a row for each figure."""
    total = Counter[str]()
    for each in sums.values():
        total.update(each)
    columns = {town: figures(each) for town, each in [*sorted(sums.items()), ("all", total)]}
    print("| | " + " | ".join(columns) + " |\n|---|" + "---:|" * len(columns))
    for name in FIGURES:
        values = (column[name] for column in columns.values())
        said = " | ".join("" if value is None else f"{value:.2f}" for value in values)
        print(f"| {name.replace('_', ' ')} | {said} |")


def parts_ms(perception: Perception, moments: Moments) -> dict[str, float]:
    """Milliseconds of the processor that one moment takes, part by part."""
    bank = perception.empty_bank(1, like=torch.zeros(1))
    images = tuple(group[:1] for group in moments.images)
    points = None if moments.points is None else moments.points[:1]
    rounds = list[list[float]]()
    names = ("encode", "fuse", "heads", "read")
    with torch.inference_mode():
        for _ in range(LOOKS):
            ticks = [time.process_time()]
            encoded: Encoded = perception.encode(images, points)
            ticks.append(time.process_time())
            bev = perception.fuse(encoded, moments.poses[:1], bank)
            ticks.append(time.process_time())
            heads = perception.say(bev, encoded)
            ticks.append(time.process_time())
            read_seen(heads, perception.config.grid)
            ticks.append(time.process_time())
            rounds.append([1e3 * (b - a) for a, b in pairwise(ticks)])
    return dict(zip(names, map(statistics.median, zip(*rounds, strict=True)), strict=True))


def main() -> None:
    """Measures, and prints both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("policy", type=Path, help="folder of a policy with sensors")
    parser.add_argument("drives", type=Path, help="folder of drives it has not learnt from")
    parser.add_argument("--moments", type=int, default=400)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    policy = from_pretrained(arguments.policy)
    print_table(measured(policy, arguments.drives, arguments.moments))
    fuse_norms(policy)
    chosen = load_moments([arguments.drives], 0.2)
    drive = read_drive(chosen.paths[0])
    renderer = SequenceRenderer(policy.config, *town_of(drive), depth=False)
    assert policy.perception is not None
    parts = parts_ms(policy.perception, renderer.sequence(drive, 5, 1, Variation(share=0.0), 0))
    print(", ".join(f"{name} {value:.1f} ms" for name, value in parts.items()), end="; ")
    print(f"together {sum(parts.values()):.1f} ms")


if __name__ == "__main__":
    main()
