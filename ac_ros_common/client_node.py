"""A node beside the loop, with a ROS context of its own: bringup's, the live page's, and those that only look."""

from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ac_ros_common.exit_watchdog import bounded

#: How long the middleware may take to let go of the node. Then the process ends: nothing else helps (`exit_watchdog`).
LEAVE_S = 10.0


@contextmanager
def client_node(
    name: str, namespace: str = "", domain: int | None = None
) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    """Give a node and the executor that has it to spin; both end afterwards. What it logs stays in this process.

    Parameters
    ----------
    name, namespace : str
    domain : int, optional
        ROS domain; None: what ROS_DOMAIN_ID says. Given directly it leaves the next one in this process free to choose.
    """
    context = rclpy.Context()
    # Signals stay Python's: bringup must not lose its middleware before it has stopped the nodes.
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO, args=[], domain_id=domain)
    # With the parameter services that every node has: `ros2 param list` waits long for one without.
    node = rclpy.create_node(name, namespace=namespace, context=context, enable_rosout=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        with bounded(LEAVE_S):
            executor.shutdown()
            node.destroy_node()
            context.try_shutdown()
