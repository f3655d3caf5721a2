"""MILE: a model of the world whose state decides, and that can go on without looking."""

from agents.zoo.mile.config import CONFIGS
from agents.zoo.mile.model import Mile
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=Mile, eyes="driveinsight")
