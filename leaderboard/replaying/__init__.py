"""Recorded drives driven again: replayed, retraced with their agent, branched, verified."""
