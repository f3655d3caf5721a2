"""Studies: an agent driven with and without an edit, over the same worlds, and what that says.

rows            what is edited, by name
looking_ahead   what there is to drive for an agent, before it is driven
driving         drives each row as an ordinary run; goes on where it was stopped
record          study.json: all that tables and figures are drawn from
effects         paired differences, their intervals and verdicts
"""

from __future__ import annotations


class StudyError(Exception):
    """A study that cannot be driven, continued or read; the message says what to do."""
