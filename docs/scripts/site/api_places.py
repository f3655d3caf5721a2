"""What of the packages has a page of its own in the reference: the contents of its Python part."""

from __future__ import annotations

from collections.abc import Mapping

# What can be imported, by the page that it stands on: objects, or whole modules
API: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "api/driveinsight": (
        "driveinsight: the commands as functions",
        (
            "leaderboard.api.runs",
            "leaderboard.api.comparisons",
            "leaderboard.api.pages",
            "leaderboard.api.branches",
            "leaderboard.api.ablations",
            "leaderboard.api.requests",
        ),
    ),
    "api/environments": (
        "di_envs: environments",
        (
            "di_envs.config.RouteEnvConfig",
            "di_envs.route_env",
            "di_envs.vector_env",
            "di_envs.multi_ego",
            "di_envs.saving",
            "di_envs.reward",
            "di_envs.testing",
        ),
    ),
    "api/sensors": (
        "di_envs: sensors",
        (
            "di_envs.observation",
            "di_envs.sensors.camera.config",
            "di_envs.sensors.lidar.config",
            "di_envs.sensors.radar.config",
            "di_envs.sensors.inertial",
            "di_envs.sensors.weather",
        ),
    ),
    "api/towns": (
        "di_envs: towns, routes, suites",
        ("di_envs.town.loading", "di_envs.town.plan", "di_envs.town.queries", "di_envs.suites"),
    ),
    "api/edits": (
        "Edits of the world and of what is seen",
        (
            "di_envs.edits.world",
            "di_envs.edits.conditions",
            "wrappers.interventions.edit",
            "wrappers.interventions.editing",
            "wrappers.interventions.presence",
            "wrappers.interventions.values",
            "wrappers.interventions.losing",
        ),
    ),
    "api/wrappers": (
        "wrappers: actions, features, Stable-Baselines3",
        ("wrappers.actions", "wrappers.vectors", "wrappers.prompt_features", "wrappers.sb3"),
    ),
    "api/agents": (
        "agents: the contract, loading, controllers",
        ("agents.base", "agents", "agents.versions", "di_envs.actions.controllers"),
    ),
    "api/policy": (
        "agents.driveinsight: the paper's policy",
        (
            "agents.driveinsight.config",
            "agents.driveinsight.model",
            "agents.driveinsight.agent",
            "agents.driveinsight.weights",
            "agents.explain.protocol",
            "agents.networks.taps",
        ),
    ),
    "api/records": (
        "leaderboard: scores, records, replays",
        (
            "leaderboard.scoring.score",
            "leaderboard.records.record",
            "leaderboard.records.results",
            "leaderboard.running.runner",
            "leaderboard.running.jobs",
            "leaderboard.replaying.replay",
            "leaderboard.replaying.branch",
            "leaderboard.replaying.verify",
            "leaderboard.statistics.confidence",
            "leaderboard.statistics.bootstrap",
        ),
    ),
}
