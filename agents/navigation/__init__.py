"""What agents for CARLA import from its `agents.navigation`: road options, planners, drivers."""
