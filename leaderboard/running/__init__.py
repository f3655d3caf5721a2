"""Driving: a run as jobs, an episode with an agent, and what people see of it."""
