"""InterFuser: all views in one transformer, and a safety controller on top."""

from agents.zoo.interfuser.config import CONFIGS
from agents.zoo.interfuser.model import Interfuser
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=Interfuser)
