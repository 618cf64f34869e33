"""Dynamics of the 3-PPRS parallel robot with friction in every joint."""

from pprs_dynamics.errors import PprsError
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.model.drive_model import DriveForces, DriveModel, ModelState

__all__ = ['DriveForces', 'DriveModel', 'ModelState', 'PlatformMotion', 'PprsError']
__version__ = '0.1.0'
