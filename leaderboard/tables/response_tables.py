"""Responses by situation, the paper's sentences put to the test, and steady heads: as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from agents.explain.situations import SAYS
from di_envs.files.json_text import indented
from di_envs.files.whole import write_whole
from leaderboard.responding.by_situation import by_situation, moments_of
from leaderboard.responding.claims import LEVEL, SLIGHT, Finding, examined
from leaderboard.responding.drive_responses import DriveResponses, plain_words
from leaderboard.responding.heads import HeadConsistency, head_consistency, verdict_of_heads
from leaderboard.responding.response_values import response_values
from leaderboard.statistics.bootstrap import BootstrapInterval
from leaderboard.tables.text_table import TextTable


def tables_of(drives: Sequence[DriveResponses]) -> list[TextTable]:
    """All there is to say of drives of one policy; one drive tests nothing."""
    heads = head_consistency(drives)
    tables = [situation_rows(drives)]
    if len(drives) > 1:
        tables.append(claim_rows(examined(drives)))
    return [*tables, head_rows(heads)] if heads is not None else tables


def write_tables(
    folder: Path, drives: Sequence[DriveResponses], tables: Sequence[TextTable]
) -> tuple[Path, Path]:
    """Writes `responses.md` and `responses.json`.

    Raises:
        OSError: If they cannot be written.
    """
    text, numbers = folder / "responses.md", folder / "responses.json"
    write_whole(text, "\n".join(table.markdown() for table in tables))
    values = response_values(drives, examined(drives), head_consistency(drives))
    write_whole(numbers, indented(values))
    return text, numbers


def situation_rows(drives: Sequence[DriveResponses]) -> TextTable:
    """The strength of each component's response in each situation."""
    found, moments = by_situation(drives), moments_of(drives)
    names = [name for name in drives[0].situations if moments[name]]
    return TextTable(
        title=f"Mean response by situation: {drives[0].name}",
        columns=("component", *(f"{plain_words(name)}\n{moments[name]} moments" for name in names)),
        rows=tuple(
            (plain_words(group), *(_give_or_take(cells[name]) for name in names))
            for group, cells in found.items()
        ),
        notes=(
            "Length of (Gx, Gy), metres of the mean waypoint per unit of token, over "
            f"{len(drives)} drives of {_routes(drives)} distinct routes; ± half a 95 % interval.",
            *(f"{plain_words(name)}: {SAYS[name]}" for name in names if name in SAYS),
        ),
    )


def claim_rows(found: Sequence[Finding]) -> TextTable:
    """The paper's sentences, each with its numbers and verdict."""
    level = 100.0 * (1.0 - (1.0 - LEVEL) / max(len(found), 1))
    sentences = list(dict.fromkeys((each.claim.sentence, each.claim.source) for each in found))
    rows = []
    for each in found:
        claim = each.claim
        rows.append(
            (
                str(sentences.index((claim.sentence, claim.source)) + 1),
                f"{plain_words(claim.component)} {claim.kind}",
                plain_words(claim.when),
                str(each.moments),
                _ratio(each.strength),
                each.verdict,
                _ratio(each.share),
                each.share_verdict,
            )
        )
    return TextTable(
        title="The paper's sentences on responses, put to the test",
        columns=("", "tested", "when", "moments", "strength", "verdict", "share", "verdict"),
        rows=tuple(rows),
        notes=(
            *(f"{n}: {said} ({where})" for n, (said, where) in enumerate(sentences, start=1)),
            "rises: in the situation over all other moments; stands out: over the mean component.",
            f"holds: the whole interval above 1; does not hold: below {SLIGHT:g}. Intervals over "
            f"routes of {level:.1f} %, {100 * LEVEL:g} % for all of them together.",
        ),
        words=3,
    )


def head_rows(found: HeadConsistency) -> TextTable:
    """How steady the heads are, and what each attends to most."""
    layers, heads = found.heads.shape
    return TextTable(
        title="Consistency of heads over time, and what each attends to most",
        columns=("", *(f"head {head}" for head in range(heads))),
        rows=tuple(
            (
                f"layer {layer}",
                *(
                    f"{found.heads[layer, head]:.2f} {plain_words(found.favourites[layer][head])}"
                    for head in range(heads)
                ),
            )
            for layer in range(layers)
        ),
        notes=(
            f"All heads: {_mean(found.mean)}. Heads of a layer with each other: "
            f"{_mean(found.alike)}. Difference: {_mean(found.excess)}.",
            f"Heads keep preferences of their own (section 4.2.3): {verdict_of_heads(found)}.",
            "Consistency: mean correlation of a head's shares between moments of a drive. Heads of "
            "an untrained policy are steady too: compare.",
        ),
    )


def _routes(drives: Sequence[DriveResponses]) -> int:
    return len({drive.route_hash for drive in drives})


def _mean(interval: BootstrapInterval) -> str:
    return _with_ends(interval, "{:.3g}")


def _give_or_take(interval: BootstrapInterval) -> str:
    """`2.74 ±0.26`: half the interval's width."""
    if not math.isfinite(interval.value):
        return "-"
    if interval.low is None or interval.high is None:
        return f"{interval.value:.3g}"
    return f"{interval.value:.3g} ±{(interval.high - interval.low) / 2.0:.2g}"


def _ratio(interval: BootstrapInterval) -> str:
    return _with_ends(interval, "{:.2f}")


def _with_ends(interval: BootstrapInterval, form: str) -> str:
    """`1.31 (1.20 … 1.42)`; the value alone where there are too few routes for ends."""
    if not math.isfinite(interval.value):
        return "-"
    value = form.format(interval.value)
    if interval.low is None or interval.high is None:
        return value
    return f"{value} ({form.format(interval.low)} … {form.format(interval.high)})"
