"""What agents for the CARLA Leaderboard derive from, where they import it from."""
