"""A few drives in the smallest training town, and policies small enough to be trained in a test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from agents.training.collect import DriveJob, drive_job


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def drives(tmp_path_factory):
    """A folder with two drives in `small_grid`."""
    folder = tmp_path_factory.mktemp("drives")
    kept = 0
    for number in range(10):
        kept += drive_job(DriveJob(folder=folder, town="small_grid", number=number)).moments > 0
        if kept == 2:
            return folder
    raise AssertionError("the expert drove less than two of ten routes without a fault")
