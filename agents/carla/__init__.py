"""Agents written for the CARLA Leaderboard, their files unchanged, behind our contract."""
