"""What cameras and LiDAR see: the ground as a raster, and everything on it as boxes."""
