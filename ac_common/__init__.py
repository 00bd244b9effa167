"""The contract between the nodes: topics, signals, faults, files, units. No ROS, none of our other packages."""
