"""The 3-PPRS in two physics engines, which share no kinematics with the package."""
