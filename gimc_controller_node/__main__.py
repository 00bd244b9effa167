"""`python -m gimc_controller_node`: the node `gimc_controller`."""

import sys

from ac_ros_common.installation import begin_node


def main() -> int:
    """Run the node."""
    begin_node()  # before anything imports rclpy
    from gimc_controller_node.node import main as run

    return run()


def compensator() -> int:
    """Run the node `compensator`."""
    begin_node()
    from gimc_controller_node.compensator_node import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
