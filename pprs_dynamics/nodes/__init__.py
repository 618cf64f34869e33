"""ROS 2 nodes: message -> conversion -> one call -> conversion -> publish. No mathematics here."""
