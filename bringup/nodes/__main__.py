"""The console scripts of the nodes `scenario` and `recorder`."""

from ac_ros_common.installation import begin_node


def scenario() -> int:
    """Run the node `scenario`."""
    begin_node()  # before anything imports rclpy
    from bringup.nodes.scenario import main

    return main()


def recorder() -> int:
    """Run the node `recorder`."""
    begin_node()
    from bringup.nodes.recorder import main

    return main()
