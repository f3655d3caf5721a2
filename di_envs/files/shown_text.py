"""Text from elsewhere within a line, a document or a figure of ours: nothing in it is obeyed.

`plain_text` spells out what steers a terminal; here is what else a name could begin.
"""

from __future__ import annotations

import re

from di_envs.files.plain_text import plain

_MARKDOWN = re.compile(r"[<\[|]")


def in_one_line(text: str) -> str:
    """The text without line breaks: a name could go on with a line that we did not write."""
    return " ".join(text.splitlines())


def in_markdown(text: str) -> str:
    """The text as it can stand in a line of Markdown: no tag, link or cell begins in it."""
    return _MARKDOWN.sub(r"\\\g<0>", plain(", ".join(text.splitlines())))


def in_figure(text: str) -> str:
    """The text as Matplotlib draws it letter by letter: `$` begins no formula."""
    return plain(text).replace("$", r"\$")
