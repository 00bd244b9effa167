"""What is run and what it amounts to, without ROS: scenarios, the loop in one process, bags, reports."""
