"""What agents for CARLA import from its `agents.navigation`: the names of road options."""
