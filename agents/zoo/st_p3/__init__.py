"""ST-P3: what comes as occupancy, and the cheapest of many paths through it."""

from agents.zoo.st_p3.config import CONFIGS
from agents.zoo.st_p3.model import StP3
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=StP3, eyes="driveinsight")
