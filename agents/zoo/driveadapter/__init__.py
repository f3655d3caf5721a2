"""DriveAdapter: what is seen as a teacher's view, and adapters that mend what it makes of it."""

from agents.zoo.driveadapter.config import CONFIGS
from agents.zoo.driveadapter.model import DriveAdapter
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=DriveAdapter, eyes="driveinsight")
