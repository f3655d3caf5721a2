"""CARLA's `results.json`, in the layouts of its Leaderboards."""
