"""What a test makes of something that was claimed: it holds, it does not, or it stays open."""

from __future__ import annotations

from di_envs.files.text_enum import TextEnum


class ClaimVerdict(TextEnum):
    """What became of a finding of somebody else's."""

    HOLDS = "holds"
    DOES_NOT_HOLD = "does not hold"
    UNDECIDED = "undecided"


def verdict_of_interval(
    low: float | None, high: float | None, *, holds_above: float, fails_below: float
) -> ClaimVerdict:
    """The verdict on "more than `holds_above`" by an interval.

    Args:
        low: End of the interval; None where there is none.
        high: The other.
        holds_above: Where the claim begins to be true.
        fails_below: Above that, or the same: what lies below is too little for the claim.
    """
    if low is None or high is None:
        return ClaimVerdict.UNDECIDED
    if low > holds_above:
        return ClaimVerdict.HOLDS
    return ClaimVerdict.DOES_NOT_HOLD if high < fails_below else ClaimVerdict.UNDECIDED
