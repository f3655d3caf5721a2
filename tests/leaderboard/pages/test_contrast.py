"""Text on pages can be read: a contrast of 4.5 at least (WCAG 2.2, AA), by day and by night."""

from __future__ import annotations

import re

import pytest

from leaderboard.pages.markup import static_text

TEXTS = ("ink", "faint", "accent", "bad")
GROUNDS = ("page", "panel", "hover")


def themes(sheet="style.css"):
    """A style sheet's colours, light and dark."""
    style = static_text(sheet)
    light, dark = (
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", block))
        for block in re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]
    )
    return {"light": light, "dark": {**light, **dark}}


def luminance(colour):
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_as_it_is_defined():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("ground", GROUNDS)
def test_text_can_be_read(theme, ground):
    colours = themes()[theme]
    found = {text: contrast(colours[text], colours[ground]) for text in TEXTS}
    assert min(found.values()) >= 4.5, found


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_names_of_responses_can_be_read_in_their_colours(theme):
    panel, colours = themes()[theme]["panel"], themes("explain.css")[theme]
    found = {name: contrast(colours[name], panel) for name in ("gx", "gy", "attention")}
    assert min(found.values()) >= 4.5, found


def test_no_text_is_faded():
    text = static_text("style.css") + static_text("explain.css")
    faded = re.findall(r"([^{}]+)\{[^{}]*opacity: 0?\.\d", text)
    assert {rule.strip() for rule in faded} == {"#ticks i.minor", "#ways path", ".cursor"}
