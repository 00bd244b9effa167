"""ROS 2 bags: writing, reading, feeding them through a node again."""
