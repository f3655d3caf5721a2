"""What agents for the CARLA Leaderboard import from its `leaderboard.utils`."""
