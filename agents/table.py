"""The drivers that have a name, and the schemes by which files drive: two literal tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class AgentEntry:
    """A line of the table of agents.

    Its `version` is raised by any change after which the agent acts otherwise in the same world;
    `tests/golden` says when that is due. Weights are told by a hash, not by it.
    """

    entry_point: str  # module:Class
    summary: str
    version: int
    options: Mapping[str, Any] = field(default_factory=dict)  # keyword arguments of the class
    argument: str = "path"  # of the class, for what follows a scheme's colon
    data: str = ""  # folder beside this file that the agent reads, such as weights
    data_files: tuple[str, ...] = ()  # those of a folder that decide what it does; () for all
    packages: tuple[str, ...] = ()  # whose version can change what it does
    score: str = ""  # driving score on town05_short, three seeds, of a system of the zoo


POLICY_FILES = ("config.json", "weights.safetensors")  # that decide what a policy does


def _policy(name: str, summary: str, *, version: int) -> AgentEntry:
    """A shipped policy of the paper's network: its name, what it is given or was taught."""
    return AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary=summary,
        version=version,
        options={"shipped": name},
        data=f"driveinsight/weights/{name}",
        data_files=POLICY_FILES,
        packages=("torch",),
    )


def _system(
    name: str, agent: str, summary: str, *, score: str = "", version: int = 1
) -> AgentEntry:
    """A system of the zoo: its name, `folder:Class` of its driver, what it is, how well it does."""
    folder, _, driver = agent.partition(":")
    return AgentEntry(
        entry_point=f"agents.zoo.{folder}.agent:{driver}",
        summary=summary,
        version=version,
        options={"shipped": name},
        data=f"zoo/{folder}/weights/{name}",
        data_files=POLICY_FILES,
        packages=("torch",),
        score=score,
    )


AGENTS: dict[str, AgentEntry] = {
    "expert": AgentEntry(
        entry_point="agents.expert.agent:Expert",
        summary="rules over what is visible: follows, predicts, yields, obeys lights and signs",
        version=3,
    ),
    "expert-told": AgentEntry(
        entry_point="agents.expert.agent:Expert",
        summary="the expert that sees through walls and knows where somebody will step out",
        version=2,
        options={"told": True},
    ),
    "expert-blind": AgentEntry(
        entry_point="agents.expert.agent:Expert",
        summary="the expert that ignores all other actors (a control for traffic's politeness)",
        version=3,
        options={"ignore_actors": True},
    ),
    "expert-redrunner": AgentEntry(
        entry_point="agents.expert.agent:Expert",
        summary="the expert that ignores traffic lights (a control for the red-light rule)",
        version=3,
        options={"ignore_lights": True},
    ),
    "expert-signrunner": AgentEntry(
        entry_point="agents.expert.agent:Expert",
        summary="the expert that ignores stop signs (a control for the stop-sign rule)",
        version=3,
        options={"ignore_signs": True},
    ),
    "highway": AgentEntry(
        entry_point="agents.highway:HighwayAgent",
        summary="highway-env's own IDM, MOBIL and steering controllers; knows no lights or signs",
        version=1,
        packages=("highway-env",),
    ),
    "driveinsight": _policy(
        "driveinsight",
        "the paper's policy: cameras, LiDAR and prompt to waypoints",
        version=4,
    ),
    "driveinsight-told": _policy(
        "driveinsight-told",
        "a policy that is told all of the prompt and sees nothing: the bound of planning",
        version=1,
    ),
    "driveinsight-sensors": _policy(
        "driveinsight-sensors",
        "a policy that sees by cameras and LiDAR, and is told its way and speed alone",
        version=1,
    ),
    "driveinsight-town05": _policy(
        "driveinsight-town05",
        "as driveinsight, with drives of Town05 in training, as the paper's main row",
        version=2,
    ),
    "driveinsight-budget": _policy(
        "driveinsight-budget",
        "as driveinsight, taught by the samples of the zoo's systems alone",
        version=1,
    ),
    "route-only": _policy(
        "route-only",
        "a policy that knows its way and speed alone (a control for whoever claims to see)",
        version=1,
    ),
    "ego-only": _system(
        "ego-only",
        "ego_only:EgoOnlyAgent",
        "AD-MLP: target, command and speed alone, the floor",
        score="29.2",
    ),
    "roach-raster": _system(
        "roach-raster",
        "roach_raster:RoachAgent",
        "Roach: the true view from above, the teacher",
        score="88.8",
    ),
    "transfuser": _system(
        "transfuser",
        "transfuser:TransfuserAgent",
        "images and LiDAR joined at several scales",
        score="85.9",
    ),
    "interfuser": _system(
        "interfuser",
        "interfuser:InterfuserAgent",
        "all views in a transformer, safety controller",
        score="72.0",
    ),
    "lbc-teacher": _system(
        "lbc-teacher",
        "lbc:LbcAgent",
        "Learning by Cheating: who sees the truth and teaches lbc",
        score="98.1",
    ),
    "ppo": AgentEntry(
        entry_point="agents.zoo.ppo.agent:PpoAgent",
        summary="Stable-Baselines3's PPO on prompts: what learns from reward alone",
        version=1,
        options={"shipped": "ppo"},
        data="zoo/ppo/weights/ppo",
        data_files=("ppo.zip",),
        packages=("stable-baselines3", "torch"),
        score="70.7",
    ),
    "lbc": _system(
        "lbc", "lbc:LbcAgent", "Learning by Cheating: the student with cameras", score="41.8"
    ),
    "vad": _system(
        "vad", "vad:VadAgent", "others and lines as vectors, which an ego query asks", score="41.8"
    ),
    "mile": _system(
        "mile", "mile:MileAgent", "a model of the world, which can imagine too", score="75.0"
    ),
    "st-p3": _system(
        "st-p3",
        "st_p3:StP3Agent",
        "what comes as occupancy, and the cheapest path",
        score="74.2",
    ),
    "thinktwice": _system(
        "thinktwice",
        "thinktwice:ThinkTwiceAgent",
        "a plan, mended by what comes if it is driven",
        score="76.7",
    ),
    "driveadapter": _system(
        "driveadapter",
        "driveadapter:DriveAdapterAgent",
        "masks for a frozen teacher, with adapters",
        score="95.0",
    ),
    "constant": AgentEntry(
        entry_point="agents.constant:ConstantAgent",
        summary="the same control for ever",
        version=1,
    ),
    "random": AgentEntry(
        entry_point="agents.random:RandomAgent",
        summary="keyed uniform controls, each held for a second",
        version=1,
    ),
}

# What stands before a colon: how the file that follows it is driven. A module of such a name can
# still be reached by a longer one, or by its file.
SCHEMES: dict[str, AgentEntry] = {
    "carla": AgentEntry(
        entry_point="agents.carla.agent:CarlaAgent",
        summary="carla:FILE.py[?config=FILE&leaderboard=2.1]: an agent for the CARLA Leaderboard",
        version=3,
        argument="file",
        packages=("highway-env", "stable-baselines3", "torch"),
    ),
    "driveinsight": AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary="driveinsight:FOLDER, :hf:OWNER/REPO: a policy that `driveinsight train` wrote",
        version=2,
        argument="weights",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "zoo": AgentEntry(
        entry_point="agents.zoo.loading:FolderDriver",
        summary="zoo:FOLDER[?rules=off], :hf:OWNER/REPO: a system that `driveinsight train` wrote",
        version=1,
        argument="weights",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "true-sight": AgentEntry(
        entry_point="agents.training.true_sight:TrueSightAgent",
        summary="true-sight:FOLDER[?eyes=blurred]: one whose eyes are the simulator (PRIVILEGED)",
        version=1,
        argument="weights",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "human": AgentEntry(
        entry_point="agents.human.agent:HumanAgent",
        summary="human:keyboard, human:gamepad: a person, in the window of `driveinsight play`",
        version=1,
        argument="by",
    ),
    "llm": AgentEntry(
        entry_point="agents.llm.agent:LanguageModelAgent",
        summary="llm:MODULE:FUNCTION[?picture=on]: told the prompt as text, answers in JSON",
        version=1,
        argument="function",
        packages=("highway-env", "stable-baselines3", "torch"),
    ),
    "pickled": AgentEntry(
        entry_point="agents.pickled:PickledAgent",
        summary="pickled:FILE.pickle: a class or an instance that `leaderboard.evaluate` was given",
        version=1,
        packages=("highway-env", "stable-baselines3", "torch"),
    ),
    "sb3": AgentEntry(
        entry_point="agents.sb3.agent:Sb3Agent",
        summary="sb3:FILE.zip[?control_dt_s=0.2]: a model of Stable-Baselines3 or sb3-contrib",
        version=1,
        packages=("sb3-contrib", "stable-baselines3", "torch"),
    ),
}
