"""LiDAR: rays against the same scene that the cameras show."""
