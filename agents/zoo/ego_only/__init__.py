"""AD-MLP: the floor that shows what a score says."""

from agents.zoo.ego_only.config import CONFIGS
from agents.zoo.ego_only.model import EgoOnly
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=EgoOnly)
