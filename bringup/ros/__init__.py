"""The ROS edge: messages, the shell that all nodes share, processes, the graph of them."""
