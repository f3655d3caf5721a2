"""ThinkTwice: a coarse plan, then look where it leads, predict, and mend it."""

from agents.zoo.system import System
from agents.zoo.thinktwice.config import CONFIGS
from agents.zoo.thinktwice.model import ThinkTwice

SYSTEM = System(configs=CONFIGS, model=ThinkTwice, eyes="driveinsight")
