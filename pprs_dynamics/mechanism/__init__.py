"""The 3-PPRS as a rigid mechanism: robot, motion, kinematics and frictionless dynamics."""
