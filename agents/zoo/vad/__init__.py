"""VAD: vectors of agents and lines, and an ego query that asks both."""

from agents.zoo.system import System
from agents.zoo.vad.config import CONFIGS
from agents.zoo.vad.model import Vad

SYSTEM = System(configs=CONFIGS, model=Vad, eyes="driveinsight")
