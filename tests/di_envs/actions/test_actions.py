"""What passes as an action, and what is refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from di_envs.actions.checked import action_space, checked_action


def test_the_action_space_is_carlas_vehicle_control():
    space = action_space()
    assert space.low.tolist() == [0.0, -1.0, 0.0]
    assert space.high.tolist() == [1.0, 1.0, 1.0]
    assert space.dtype == np.float32


def test_every_sample_of_the_space_is_an_action():
    space = action_space()
    space.seed(3)
    for _ in range(100):
        sample = space.sample()
        assert checked_action(sample).tolist() == sample.astype(np.float64).tolist()


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.5, 0.0], r"shape \(3,\).*got shape \(2,\)"),
        ([[0.5, 0.0, 0.0]], r"got shape \(1, 3\)"),
        ([0.5, np.nan, 0.0], r"steer must be in \[-1, 1\]; got nan"),
        ([np.inf, 0.0, 0.0], r"throttle must be in \[0, 1\]; got inf"),
        ([0.0, -1.01, 0.0], r"steer must be in \[-1, 1\]; got -1.01"),
        ([0.0, 0.0, -0.1], r"brake must be in \[0, 1\]; got -0.1"),
        ("full throttle", "three numbers"),
        (None, r"got shape \(\)"),
    ],
)
def test_what_is_no_action_is_refused_with_the_entry_and_its_range(action, message):
    with pytest.raises(ValueError, match=message):
        checked_action(action)
