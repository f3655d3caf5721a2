"""Radars: distance, direction and speed of what a few rays meet in the scene."""
