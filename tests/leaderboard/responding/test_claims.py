"""The paper's sentences on drives made by hand: they hold, do not hold, or stay open."""

from __future__ import annotations

import numpy as np
import pytest

from leaderboard.responding.by_situation import by_situation, moments_of, ratios_in
from leaderboard.responding.claims import CLAIMS, RISES, STANDS_OUT, examined
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.tables.response_tables import claim_rows, situation_rows, tables_of
from tests.leaderboard.responding.made_drives import made_drive

IN_JUNCTION = [True, True, False, False]


def drives(lights, routes=5):
    """Drives of four moments, the first two in a junction; the speed's response stays 1."""
    return [
        made_drive([[each, 1.0] for each in lights], route=str(route), junction=IN_JUNCTION)
        for route in range(routes)
    ]


def found(drives, component, kind, when):
    return next(
        each
        for each in examined(drives)
        if (each.claim.component, each.claim.kind, each.claim.when) == (component, kind, when)
    )


def test_a_response_three_times_as_strong_in_junctions_holds():
    test = found(drives([3.0, 6.0, 1.0, 2.0]), "traffic_lights", RISES, "junction")
    assert test.strength.value == pytest.approx(4.5 / 1.5)
    assert test.share.value == pytest.approx((3 / 4 + 6 / 7) / (1 / 2 + 2 / 3))
    assert (test.verdict, test.share_verdict, test.moments) == (
        ClaimVerdict.HOLDS,
        ClaimVerdict.HOLDS,
        10,
    )


def test_an_equal_response_does_not_hold():
    test = found(drives([1.0, 2.0, 2.0, 1.0]), "traffic_lights", RISES, "junction")
    assert test.strength.value == 1.0
    assert test.verdict == ClaimVerdict.DOES_NOT_HOLD


def test_routes_that_disagree_leave_it_open():
    mixed = [*drives([3.0, 3.0, 1.0, 1.0], 3)]
    mixed += [
        made_drive([[v, 1.0] for v in (1.0, 1.0, 3.0, 3.0)], route=str(r), junction=IN_JUNCTION)
        for r in (7, 8, 9)
    ]
    assert found(mixed, "traffic_lights", RISES, "junction").verdict == ClaimVerdict.UNDECIDED


def test_two_routes_are_too_few_to_tell_and_so_are_two_seeds_of_each():
    few = drives([3.0, 6.0, 1.0, 2.0], 2)
    assert found(few * 3, "traffic_lights", RISES, "junction").verdict == ClaimVerdict.UNDECIDED


def test_standing_out_is_over_the_mean_component_in_the_same_moments():
    three = [
        made_drive(
            [[4.0, 1.0, 1.0], [0.1, 9.0, 9.0]],
            route=str(route),
            groups=("bev", "speed", "routing"),
            turning=[True, False],
        )
        for route in range(3)
    ]
    assert found(three, "bev", STANDS_OUT, "turning").strength.value == pytest.approx(2.0)
    assert found(three, "routing", STANDS_OUT, "turning").verdict == ClaimVerdict.DOES_NOT_HOLD


def test_a_sentence_about_a_component_that_the_policy_lacks_is_left_out():
    components = {each.claim.component for each in examined(drives([1.0] * 4))}
    assert components == {"traffic_lights", "speed"}


def test_a_situation_that_never_comes_leaves_it_open():
    test = found(drives([1.0] * 4), "speed", RISES, "stop_sign, not junction")
    assert (test.verdict, test.moments) == (ClaimVerdict.UNDECIDED, 0)
    assert np.isnan(test.strength.value)


def test_drives_of_two_policies_are_not_mixed():
    other = made_drive([[1.0]], groups=("speed",))
    with pytest.raises(ValueError, match="one policy"):
        examined([*drives([1.0] * 4), other])


def test_every_sentence_names_its_place_in_the_paper():
    assert all(claim.source.startswith(("section 4.2.3", "appendix")) for claim in CLAIMS)
    assert len(set(CLAIMS)) == len(CLAIMS)


def test_means_by_situation_are_of_the_moments_of_all_drives():
    some = drives([3.0, 5.0, 1.0, 1.0], 4)
    assert by_situation(some)["traffic_lights"]["junction"].value == 4.0
    assert by_situation(some, "share")["speed"]["junction"].value == pytest.approx(
        (1 / 4 + 1 / 6) / 2
    )
    assert by_situation(some, "Gy")["speed"]["junction"].value == 0.0
    assert moments_of(some)["junction"] == 8
    assert ratios_in(some, "junction")["traffic_lights"].value == 4.0
    assert ratios_in(some, "turning") == {}


def test_tables_leave_out_situations_that_never_came():
    some = drives([3.0, 5.0, 1.0, 1.0], 4)
    rows = situation_rows(some)
    assert rows.columns == ("component", "junction\n8 moments")
    assert rows.rows[0] == ("traffic lights", "4 ±0")
    assert "driveinsight:folder" in rows.title  # not where it lies


def test_one_drive_tests_nothing():
    titles = [table.title for table in tables_of(drives([1.0] * 4, 1))]
    assert len(titles) == 1
    assert "situation" in titles[0]


def test_markdown_has_a_row_for_each_test_and_the_sentences_below():
    text = claim_rows(examined(drives([3.0, 6.0, 1.0, 2.0]))).markdown()
    assert "| 1 | traffic lights rises | junction | 10 | 3.00 (3.00 … 3.00) | holds |" in text
    assert "1: passing an intersection, the model is more sensitive to traffic lights" in text
