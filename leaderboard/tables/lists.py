"""What there is to evaluate: agents and suites, as tables."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rich.table import Table

from agents import AGENTS, SCHEMES, AgentSpecError, load_agent
from di_envs.suites import Suite, load_suite, suite_names
from di_envs.town.loading import load_town
from di_envs.town.routing.scenarios import STAGED


def agent_table() -> Table:
    """The agents that have a name, with their track."""
    table = Table(title="agents", title_justify="left", title_style="bold")
    for column in ("name", "track", "what it does"):
        table.add_column(column)
    for name, entry in AGENTS.items():
        if not entry.data.startswith(_ZOO):
            table.add_row(name, _track(name), entry.summary)
    return table


def zoo_table() -> Table:
    """The systems of the zoo: what each sees, how large it is and how well it drives."""
    table = Table(title="the zoo", title_justify="left", title_style="bold")
    table.add_column("name")
    table.add_column("track")
    table.add_column("inputs")
    table.add_column("parameters", justify="right")
    table.add_column("town05_short", justify="right")
    table.add_column("what it is")
    for name, entry in AGENTS.items():
        if entry.data.startswith(_ZOO):
            score = entry.score or "not trained"
            table.add_row(name, *_facts_of(name), score, entry.summary)
    return table


def _facts_of(name: str) -> tuple[str, str, str]:
    """Track, inputs and parameters of a system, trained or not."""
    try:
        from agents.zoo.registry import config_of, network_of, system_names
    except ImportError as error:
        return f"needs {error.name}", "", ""
    if name in system_names():
        config = config_of(name)
        return str(config.requires.track), config.inputs, _size(network_of(config))
    agent = _loaded(name)
    if isinstance(agent, str):
        return agent, "", ""
    needs = agent.requires
    return str(needs.track), ", ".join(needs.observations), _size(agent.network)


def _size(network: Any) -> str:
    return f"{sum(parameter.numel() for parameter in network.parameters()):,}"


def scheme_table() -> Table:
    """The kinds of files that hold a driver from elsewhere, and how each is named."""
    table = Table(title="from elsewhere", title_justify="left", title_style="bold")
    for column in ("--agent", "what it is"):
        table.add_column(column)
    for entry in SCHEMES.values():
        spec, _, summary = entry.summary.partition(": ")
        table.add_row(spec, summary)
    return table


def _track(name: str) -> str:
    """The agent's track, or what is missing."""
    agent = _loaded(name)
    if isinstance(agent, str):
        return agent
    try:
        return str(agent.requires.track)
    finally:
        agent.close()


def _loaded(name: str) -> Any:
    """The agent; if its extra packages or weights are missing, which."""
    try:
        return load_agent(name)
    except ImportError as error:
        return f"needs {error.name}"
    except AgentSpecError:
        return "needs weights"


def suite_table() -> Table:
    """The shipped suites, with how many routes they hold and who else is on the road."""
    table = Table(title="suites", title_justify="left", title_style="bold")
    for column in ("name", "version", "town", "routes", "vehicles", "walkers", "what it is"):
        table.add_column(column, justify="right" if column in _NUMBERS else "left")
    for suite in map(load_suite, suite_names()):
        table.add_row(
            suite.name,
            str(suite.version),
            suite.town,
            str(len(suite.specs())),
            *_traffic_cells(suite),
            suite.description,
        )
    return table


def _traffic_cells(suite: Suite) -> tuple[str, str]:
    if suite.traffic is None:
        return "by length", "by length"
    return str(suite.traffic.vehicles), str(suite.traffic.walkers)


_ZOO = "zoo/"  # where the weights of its systems are
_NUMBERS = ("version", "routes", "vehicles", "walkers")


def scenario_table() -> Table:
    """How many scenarios of each type the routes of the shipped suites meet."""
    table = Table(title="scenarios along the routes", title_justify="left", title_style="bold")
    table.add_column("suite")
    for number in STAGED:
        table.add_column(f"S{number}", justify="right")
    for suite in map(load_suite, suite_names()):
        if suite.scenarios is not None:
            counts = _scenarios_met(suite)
            table.add_row(suite.name, *(str(counts[number]) for number in STAGED))
    return table


def _scenarios_met(suite: Suite) -> Counter[int]:
    plans = suite.plans(load_town(suite.town_path, suite.signals))
    return Counter(trigger.type for plan in plans for trigger in plan.scenarios)
