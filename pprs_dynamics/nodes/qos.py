"""How topics are delivered."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile

# Reliable, and deep enough that a listener that stalls for a tenth of a second at 1 kHz gets
# every message: each one is answered.
EVERY_MESSAGE = QoSProfile(depth=100)
# Reliable, and the last one is kept for whoever comes later.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
