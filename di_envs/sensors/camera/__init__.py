"""Pinhole cameras: colours, depth, tags and instances of the scene, a row of pixels at a time."""
