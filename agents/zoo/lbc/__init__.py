"""LBC: a teacher that sees the truth, and a student that learns its points for any target."""

from agents.zoo.lbc.config import CONFIGS
from agents.zoo.lbc.model import lbc
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=lbc)
