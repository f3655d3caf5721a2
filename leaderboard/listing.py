"""What there is to evaluate: agents and suites, as tables."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from agents import AGENTS, load_agent


def agent_table() -> Table:
    """The agents that have a name, with their track."""
    table = Table(title="agents", title_justify="left", title_style="bold")
    for column in ("name", "track", "what it does"):
        table.add_column(column)
    for name, entry in AGENTS.items():
        table.add_row(name, _track(name), escape(entry.summary))
    return table


def _track(name: str) -> str:
    """The agent's track; an agent whose extra packages are missing says which."""
    try:
        agent = load_agent(name)
    except ImportError as error:
        return f"needs {error.name}"
    try:
        return str(agent.requires.track)
    finally:
        agent.close()
