"""`python -m ac_plant_node`: the node `ac_plant`."""

import sys

from ac_ros_common.installation import begin_node


def main() -> int:
    """Run the node."""
    begin_node()  # before anything imports rclpy
    from ac_plant_node.node import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
