"""The console that everything of ours is printed on: it shows text, and obeys none.

A record, a route file or an agent may hold characters that clear a screen or turn a line around.
Whatever is printed goes through here, so nobody else has to think of them. Nor is anything read
as rich's markup: `[/b]` in a name is shown, and `[conceal]` hides nothing. Who wants a style hands
over a `Text`, or names the style.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment


class Terminal(Console):
    """Rich's console, which spells out in a text what would steer a terminal.

    Args:
        settings: As of rich's own.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(markup=False, emoji=False, **settings)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """What is shown of something; what rich itself steers with stays."""
        from di_envs.files.plain_text import plain  # loads more than a list of commands needs

        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(plain(segment.text), segment.style)
