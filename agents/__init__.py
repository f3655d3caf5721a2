"""Drivers, by name: one literal table, and `load_agent`, which reads a name or a place in code.

This module imports no driver and no kernel, so that `import agents` stays light.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agents.base import Agent


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
    score: str = ""  # driving score on town05_short, seed 0, of a system of the zoo


POLICY_FILES = ("config.json", "weights.safetensors")  # that decide what a policy does


def _system(name: str, agent: str, summary: str, *, version: int = 1) -> AgentEntry:
    """A system of the zoo: its name, `folder:Class` of its driver, and what it is."""
    folder, _, driver = agent.partition(":")
    return AgentEntry(
        entry_point=f"agents.zoo.{folder}.agent:{driver}",
        summary=summary,
        version=version,
        options={"shipped": name},
        data=f"zoo/{folder}/weights/{name}",
        data_files=POLICY_FILES,
        packages=("torch",),
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
    "driveinsight": AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary="the paper's policy: cameras, LiDAR and prompt to waypoints",
        version=2,
        options={"shipped": "driveinsight"},
        data="driveinsight/weights/driveinsight",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "driveinsight-told": AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary="a policy that is told all of the prompt and sees nothing: the bound of planning",
        version=1,
        options={"shipped": "driveinsight-told"},
        data="driveinsight/weights/driveinsight-told",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "driveinsight-sensors": AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary="a policy that sees by cameras and LiDAR, and is told its way and speed alone",
        version=1,
        options={"shipped": "driveinsight-sensors"},
        data="driveinsight/weights/driveinsight-sensors",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "route-only": AgentEntry(
        entry_point="agents.driveinsight.agent:DriveInsightAgent",
        summary="a policy that knows its way and speed alone (a control for whoever claims to see)",
        version=1,
        options={"shipped": "route-only"},
        data="driveinsight/weights/route-only",
        data_files=POLICY_FILES,
        packages=("torch",),
    ),
    "ego-only": _system(
        "ego-only", "ego_only:EgoOnlyAgent", "AD-MLP: target, command and speed alone, the floor"
    ),
    "roach-raster": _system(
        "roach-raster", "roach_raster:RoachAgent", "Roach: the true view from above, the teacher"
    ),
    "transfuser": _system(
        "transfuser", "transfuser:TransfuserAgent", "images and LiDAR joined at several scales"
    ),
    "interfuser": _system(
        "interfuser", "interfuser:InterfuserAgent", "all views in a transformer, safety controller"
    ),
    "lbc-teacher": _system(
        "lbc-teacher", "lbc:LbcAgent", "Learning by Cheating: who sees the truth and teaches lbc"
    ),
    "ppo": AgentEntry(
        entry_point="agents.zoo.ppo.agent:PpoAgent",
        summary="Stable-Baselines3's PPO on prompts: what learns from reward alone",
        version=1,
        options={"shipped": "ppo"},
        data="zoo/ppo/weights/ppo",
        data_files=("ppo.zip",),
        packages=("stable-baselines3", "torch"),
    ),
    "lbc": _system("lbc", "lbc:LbcAgent", "Learning by Cheating: the student with cameras"),
    "vad": _system("vad", "vad:VadAgent", "others and lines as vectors, which an ego query asks"),
    "mile": _system("mile", "mile:MileAgent", "a model of the world, which can imagine too"),
    "st-p3": _system("st-p3", "st_p3:StP3Agent", "what comes as occupancy, and the cheapest path"),
    "thinktwice": _system(
        "thinktwice", "thinktwice:ThinkTwiceAgent", "a plan, mended by what comes if it is driven"
    ),
    "driveadapter": _system(
        "driveadapter",
        "driveadapter:DriveAdapterAgent",
        "masks for a frozen teacher, with adapters",
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

# Packages that not everybody has, and the extra that brings each
_EXTRAS = {"torch": "policy", "safetensors": "policy", "stable_baselines3": "rl"}

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

_CONTRACT = ("requires", "start", "act", "close")


class AgentSpecError(ValueError):
    """An agent specification that names nothing, or something that is no agent."""


def load_agent(spec: str, **options: Any) -> Agent[Any]:
    """Makes the agent that `spec` names.

    Args:
        spec: A name of `AGENTS`, or `module:Class`, or `path/to/file.py:Class`, or
            `scheme:file` with a scheme of `SCHEMES`; a name and a file may be followed by
            `?option=value&option=value`.
        options: Keyword arguments of the agent's class; they override the table's.

    Raises:
        AgentSpecError: If the name, module, file or class is unknown, or the class is no agent.
    """
    name, said = named(spec)
    if name in AGENTS:
        entry = AGENTS[name]
        return _ours(spec, entry, {**entry.options, **said, **options})
    scheme, _, place = spec.partition(":")
    if scheme in SCHEMES:
        entry = SCHEMES[scheme]
        path, said = place_and_options(spec, place)
        if entry.argument in said:
            raise AgentSpecError(
                f"agent '{spec}': the {entry.argument} stands before the '?', not behind it."
            )
        given = {entry.argument: path, **said, **options}
        return _ours(spec, entry, {**entry.options, **given})
    if ":" not in spec:
        raise AgentSpecError(_unknown_name(name))
    return _make(spec, spec, options)


def named(spec: str) -> tuple[str, dict[str, str]]:
    """A name of the table, and what is said of it: `interfuser?rules=off`, as of files.

    Raises:
        AgentSpecError: If what is said is not option=value.
    """
    return (spec, {}) if ":" in spec else place_and_options(spec, spec)


def place_and_options(spec: str, place: str) -> tuple[str, dict[str, str]]:
    """A file and what is said of it: `weights.zip?device=cpu` is `weights.zip`, device: cpu.

    Args:
        spec: The whole specification, for the error.
        place: What follows the scheme's colon.

    Raises:
        AgentSpecError: If what is said is not option=value.
    """
    path, _, query = place.partition("?")
    options = dict(part.partition("=")[::2] for part in query.split("&") if part)
    for name, value in options.items():
        if not name.isidentifier() or not value:
            raise AgentSpecError(
                f"agent '{spec}': expected option=value after the '?', joined by '&'; got "
                f"'{query}'."
            )
    return path, options


def _ours(spec: str, entry: AgentEntry, options: Mapping[str, Any]) -> Agent[Any]:
    """An agent of the tables; says which extra brings a package that it lacks."""
    try:
        return _make(spec, entry.entry_point, options)
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        raise AgentSpecError(
            f"agent '{spec}' needs {error.name}, which is not installed: pip install "
            f"'driveinsight[{_EXTRAS[error.name]}]'."
        ) from error


def _make(spec: str, entry_point: str, options: Mapping[str, Any]) -> Agent[Any]:
    place, _, class_name = entry_point.rpartition(":")
    module = module_of(spec, place)
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        known = [name for name, value in vars(module).items() if _defined_in(module, value)]
        raise AgentSpecError(
            f"agent '{spec}': {place} has no class '{class_name}'; {_hint(class_name, known)}"
        )
    _check_options(spec, found, options)
    agent: Agent[Any] = found(**options)
    # on the class first: what an agent requires may take it long to find out
    missing = [n for n in _CONTRACT if not hasattr(found, n) and not hasattr(agent, n)]
    if missing:
        raise AgentSpecError(
            f"agent '{spec}': {class_name} lacks {', '.join(missing)}; an agent has "
            f"{', '.join(_CONTRACT)} (see agents/base.py)."
        )
    return agent


def _check_options(spec: str, found: type, options: Mapping[str, Any]) -> None:
    parameters = inspect.signature(found).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    for name in options:
        if name not in parameters:
            raise AgentSpecError(
                f"agent '{spec}': there is no option '{name}'; {_hint(name, list(parameters))}"
            )


def module_of(spec: str, place: str) -> ModuleType:
    """The module of a name, or of a Python file.

    Args:
        spec: The agent's specification, for the error.
        place: `package.module`, or `path/to/file.py`.

    Raises:
        AgentSpecError: If there is none. Whatever the module's own code raises goes on.
    """
    if place.endswith(".py"):
        return module_of_file(spec, Path(place))
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name is None or not (place + ".").startswith(error.name + "."):
            raise  # the module is there, something that it imports is not
        said = f"agent '{spec}': no module '{error.name}'"
        if spec.partition(":")[0] not in SCHEMES:  # perhaps no module was meant
            said += "; expected a name, module:Class or path/to/file.py:Class. "
            said += _unknown_name(place)
        raise AgentSpecError(said) from None


def module_of_file(spec: str, path: Path) -> ModuleType:
    """Imports a Python file, once.

    Raises:
        AgentSpecError: If there is none. Whatever the file's own code raises goes on.
    """
    if not path.is_file():
        raise AgentSpecError(f"agent '{spec}': there is no file {path.absolute()}.")
    path = path.resolve()
    # Named after the path, so that two files of the same name do not replace each other.
    name = f"agent_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    module_spec = importlib.util.spec_from_file_location(name, path)
    if module_spec is None or module_spec.loader is None:
        raise AgentSpecError(f"agent '{spec}': {path} cannot be imported as a Python module.")
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[name] = module
    try:
        module_spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _defined_in(module: ModuleType, value: object) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__


def _unknown_name(name: str) -> str:
    return f"unknown agent '{name}'; {_hint(name, list(AGENTS))}"


def _hint(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    start = f"did you mean '{near[0]}'? " if near else ""
    return f"{start}known: {', '.join(known) or 'none'}."


__all__ = [
    "AGENTS",
    "SCHEMES",
    "AgentEntry",
    "AgentSpecError",
    "load_agent",
    "module_of",
    "module_of_file",
]
