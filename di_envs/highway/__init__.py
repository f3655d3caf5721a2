"""Towns and scenes as highway-env objects: for its controllers, its viewer and comparisons."""
