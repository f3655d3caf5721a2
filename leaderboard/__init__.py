"""Scores agents in closed loop under the CARLA Leaderboard's rules and records what happened."""
