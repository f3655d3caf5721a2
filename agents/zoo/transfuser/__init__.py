"""TransFuser: images and LiDAR joined by attention at several scales."""

from agents.zoo.system import System
from agents.zoo.transfuser.config import CONFIGS
from agents.zoo.transfuser.model import Transfuser

SYSTEM = System(configs=CONFIGS, model=Transfuser)
