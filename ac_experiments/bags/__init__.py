"""Recordings as ROS 2 bags."""
