"""Drivers, by name: one literal table, and `load_agent`, which reads a name or a place in code.

This package imports no driver and no kernel, so that `import agents` stays light.
"""

from agents.loading import (
    AgentSpecError,
    load_agent,
    module_of,
    module_of_file,
    named,
    place_and_options,
)
from agents.table import AGENTS, POLICY_FILES, SCHEMES, AgentEntry

__all__ = [
    "AGENTS",
    "POLICY_FILES",
    "SCHEMES",
    "AgentEntry",
    "AgentSpecError",
    "load_agent",
    "module_of",
    "module_of_file",
    "named",
    "place_and_options",
]
