"""Small patches of ground are paved: which texels belong together, as networkx has it."""

from __future__ import annotations

import networkx
import numpy as np
import pytest

from di_envs.sensors.scene.patches import pave_patches

GROUND, PAVING, ROAD = 2, 7, 1


def paved_by_networkx(classes, limit):
    rows, columns = classes.shape
    grid = networkx.grid_2d_graph(rows, columns)
    graph = grid.subgraph(zip(*np.nonzero(classes == GROUND), strict=True))
    found = classes.copy()
    for patch in networkx.connected_components(graph):
        if len(patch) <= limit:
            found[tuple(np.transpose(list(patch)))] = PAVING
    return found


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.6, 0.7, 1.0])
def test_patches_are_those_of_a_grid_as_a_graph(share):
    draws = np.random.default_rng(int(100 * share))
    for rows, columns in [(1, 1), (1, 40), (40, 1), (23, 37), (40, 40)]:
        classes = np.where(draws.random((rows, columns)) < share, GROUND, ROAD).astype(np.uint8)
        for limit in (0, 1, 4, 30):
            found = classes.copy()
            pave_patches(found, limit, GROUND, PAVING)
            assert np.array_equal(found, paved_by_networkx(classes, limit))


def test_arms_that_meet_below_are_one_patch():
    classes = np.array([[2, 1, 2, 1, 2], [2, 1, 2, 1, 2], [2, 2, 2, 1, 2]], np.uint8)
    pave_patches(classes, 3, GROUND, PAVING)
    assert classes.tolist() == [[2, 1, 2, 1, 7], [2, 1, 2, 1, 7], [2, 2, 2, 1, 7]]
