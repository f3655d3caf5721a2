"""Pages for a browser: self-contained HTML with a replay of what was driven, and how it is packed.

`docs/report.md` says what a page holds and how others may build on the same player.
"""
