"""Roach: the teacher that sees the true view from above."""

from agents.zoo.roach_raster.config import CONFIGS
from agents.zoo.roach_raster.model import RoachRaster
from agents.zoo.system import System

SYSTEM = System(configs=CONFIGS, model=RoachRaster)
