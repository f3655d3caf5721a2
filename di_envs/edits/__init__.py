"""Edits: the text form that all of them share, when they hold, and those of the world itself."""
