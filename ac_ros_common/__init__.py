"""What every ROS node of the loop stands on: life cycle, parameters, ticks, health, a clean end."""
