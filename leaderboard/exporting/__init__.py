"""Agents of ours as files for other people's simulators."""
