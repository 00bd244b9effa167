"""`python -m fault_injector_node`: the node `fault_injector`."""

import sys

from ac_ros_common.installation import begin_node


def main() -> int:
    """Run the node."""
    begin_node()  # before anything imports rclpy
    from fault_injector_node.node import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
