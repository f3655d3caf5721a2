"""Sensors: pure functions of the world's state."""
