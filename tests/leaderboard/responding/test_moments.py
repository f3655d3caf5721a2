"""Which moments are marked, and how stretches of a situation are told."""

from __future__ import annotations

import numpy as np

from leaderboard.responding.moments import marked_moments, moment_name, stretches
from tests.leaderboard.responding.made_drives import made_drive


def span(count, first, last):
    return [first <= n < last for n in range(count)]


def test_stretches_have_a_first_and_a_last():
    assert stretches(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert stretches(np.zeros(3, bool)) == []


def test_the_middle_of_the_longest_stretch_of_each_situation_is_marked():
    turning = np.array(span(40, 0, 2)) | span(40, 10, 15)
    drive = made_drive([[1.0, 1.0]] * 40, turning=turning, junction=span(40, 30, 33))
    assert marked_moments(drive) == (12, 31)
    assert moment_name(drive, 12) == "t = 6.0 s (turning)"
    assert moment_name(drive, 0) == "t = 0.0 s (turning)"
    assert moment_name(drive, 5) == "t = 2.5 s (between situations)"


def test_moments_closer_than_two_seconds_are_marked_once():
    drive = made_drive([[1.0, 1.0]] * 40, turning=span(40, 10, 15), light=span(40, 12, 17))
    assert marked_moments(drive) == (12,)


def test_a_second_before_the_first_infraction_is_marked():
    drive = made_drive([[1.0, 1.0]] * 40, events=((10.0, "red light"), (15.0, "blocked")))
    assert marked_moments(drive) == (18,)


def test_moments_that_are_asked_for_are_marked_and_no_others():
    drive = made_drive([[1.0, 1.0]] * 40, turning=span(40, 10, 15))
    assert marked_moments(drive, (3.2, 99.0, 3.1)) == (6, 39)


def test_a_drive_without_situations_has_its_middle_marked():
    assert marked_moments(made_drive([[1.0, 1.0]] * 9)) == (4,)
