"""What bringup tells: the user, /rosout, and /diagnostics, and so the bag."""

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import Log
from rclpy.node import Node

from ac_common.health import BringupReport
from ac_common.topics import BRINGUP, NAMESPACE
from ac_ros_common.health_publisher import HARDWARE
from ac_ros_common.qos import PLAIN_QOS, ROSOUT_QOS
from bringup.launch.reports import Reports
from bringup.launch.restarts import Restarts


class Announcer:
    """Tells what bringup has seen and done.

    Parameters
    ----------
    node : Node
    health : Reports
        Last health report of each node.
    say : callable
        Tells the user a line.

    Attributes
    ----------
    plant_stamp : Time
        Of the plant's last health report: in lockstep, the time on the graph's clock.
    """

    def __init__(self, node: Node, health: Reports, say: Callable[[str], None]) -> None:
        self._node, self._health, self._say = node, health, say
        self.plant_stamp = Time()
        self._rosout = node.create_publisher(Log, "/rosout", ROSOUT_QOS)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", PLAIN_QOS)

    def tell(self, line: str) -> None:
        """Tell the user, and whoever listens to /rosout."""
        self._say(line)
        self._rosout.publish(Log(stamp=self._now(), level=Log.WARN, name=f"{NAMESPACE[1:]}.{BRINGUP}", msg=line))

    def report(self, restarts: Restarts, unexpected: list[str]) -> None:
        """Publish the health of bringup itself: what was started again, and what is there and does not belong."""
        message = DiagnosticArray(status=[_health(restarts, unexpected)])
        message.header.stamp = self._now()
        self._diagnostics.publish(message)

    def _now(self) -> Any:
        is_lockstep = self._health.of_plant().first_ns == 0
        return self.plant_stamp if is_lockstep else self._node.get_clock().now().to_msg()


def _health(restarts: Restarts, unexpected: list[str]) -> DiagnosticStatus:
    waiting = restarts.waiting
    said = BringupReport(tuple(restarts.all), tuple(unexpected)).values()
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if waiting or unexpected else DiagnosticStatus.OK,
        name=f"{NAMESPACE}/{BRINGUP}",
        hardware_id=HARDWARE,
        message=f"restarting {', '.join(waiting)}" if waiting else "; ".join(unexpected) or "all is well",
        values=[KeyValue(key=key, value=value) for key, value in said.items()],
    )
