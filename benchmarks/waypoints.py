"""How far the plans of a system are from what the expert drove, on drives kept out of training.

    python benchmarks/waypoints.py runs/zoo/vad/policy --data runs/zoo/expert
    python benchmarks/waypoints.py agents/zoo/transfuser/weights/transfuser --data runs/zoo/expert

Of each waypoint the mean distance along the car and to its side, as it sees and with black cameras
and an empty LiDAR, and Pearson's correlation of what was planned and driven to the side: about 0 is
who does not steer; beside them how far what was driven is from a car that goes straight on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import track

from agents.networks.weights import WeightsError
from agents.training.config import TrainConfig, TrainingError
from agents.training.frames import DriveFileError
from agents.training.loading import Samples
from agents.training.moments import load_moments
from agents.training.samples import Batch, batch_of
from agents.zoo.system import MOMENT_DT_S, Output, SystemModel
from agents.zoo.weights import load_system

MODES = ("seen", "blind")
BATCH = 16


def planned(network: SystemModel, batch: Batch, *, blind: bool) -> np.ndarray:
    """(B, T, 2) waypoints [m] after all moments of a batch."""
    output: Output | None = None
    hidden = (*network.config.cameras, *(["lidar"] if network.config.lidar else []))
    for moment in batch.inputs:
        seen = {
            name: torch.zeros_like(value) if blind and name in hidden else value
            for name, value in moment.items()
        }
        output = network(seen, output.state if output else None)
    assert output is not None, "a batch has a moment"
    return output.waypoints.float().numpy()


def _likeness(plan: np.ndarray, driven: np.ndarray) -> tuple[float, float, float]:
    """Of (N, 2) places: mean distances along and aside [m], and the correlation of those aside."""
    along, aside = np.abs(plan - driven).mean(axis=0)
    return along, aside, np.corrcoef(plan[:, 1], driven[:, 1])[0, 1]


def main() -> None:
    """Prints a row for each waypoint."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("system", type=Path, help="folder of a trained system of the zoo")
    parser.add_argument("--data", type=Path, required=True, help="folder of the expert's drives")
    parser.add_argument("--moments", type=int, default=320, help="default: 320")
    arguments = parser.parse_args()
    if arguments.moments < BATCH:
        parser.error(f"--moments must be at least {BATCH}, not {arguments.moments}")
    torch.set_num_threads(1)
    # as recipes keep drives out, so that none was learnt from
    config = TrainConfig(
        steps=1, batch=BATCH, held_out=0.05, measured_moments=arguments.moments // BATCH * BATCH
    )
    try:
        network = load_system(arguments.system).eval()
        moments = load_moments([arguments.data], config.standing_share)
    except (WeightsError, TrainingError, DriveFileError) as error:
        parser.error(str(error))
    samples = Samples(network.config, config, moments)
    plans: dict[str, list[np.ndarray]] = {mode: [] for mode in MODES}
    truths, valid = list[np.ndarray](), list[np.ndarray]()
    numbers = range(len(samples), len(samples) + config.measured, BATCH)
    for first in track(numbers, "looking", console=Console(stderr=True), transient=True):
        batch = batch_of([samples[number] for number in range(first, first + BATCH)])
        with torch.no_grad():
            for mode in MODES:
                plans[mode].append(planned(network, batch, blind=mode == "blind"))
        truths.append(batch.targets["waypoints"].numpy())
        valid.append(batch.targets["valid"].numpy() > 0.0)
    truth, known = np.concatenate(truths), np.concatenate(valid)
    planned_by = {mode: np.concatenate(plans[mode]) for mode in MODES}
    print(f"{network.config.name}, {len(truth)} moments\n")
    of_mode = "along [m] | aside [m] | r aside"
    print(f"| after [s] | moments | {of_mode} | blind: {of_mode} | truth aside [m] |")
    print("|" + "---:|" * 9)
    for step in range(truth.shape[1]):
        there = known[:, step]
        driven = truth[there, step]
        cells = [_likeness(planned_by[mode][there, step], driven) for mode in MODES]
        row = " | ".join(f"{value:.2f}" for cell in cells for value in cell)
        aside = np.abs(driven[:, 1]).mean()
        print(f"| {MOMENT_DT_S * (step + 1):.1f} | {there.sum()} | {row} | {aside:.2f} |")


if __name__ == "__main__":
    main()
