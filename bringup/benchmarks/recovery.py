"""How long until a killed node is back in service, and until an unexpected publisher has been reported."""

import time
from pathlib import Path

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState

from ac_common.health import BringupReport
from ac_common.topics import BRINGUP, COMPENSATOR, CONTROLLER, FDI, INJECTOR, NAMESPACE, RECORDER, SCENARIO
from ac_common.wire import read_diagnostics
from ac_experiments.bags.reader import read_raw
from ac_experiments.scenario import load
from ac_ros_common.qos import LOOP_QOS
from bringup.benchmarks.children import node_processes
from bringup.benchmarks.figure import Figure
from bringup.launch.launch import run_graph

KILLED = (FDI, COMPENSATOR, RECORDER, CONTROLLER, INJECTOR, SCENARIO)
#: Time for each, s: to come back, and for the loop to settle.
EACH_S = 5.0
BACK_BAR_S, REPORTED_BAR_S = 3.0, 1.0
UNEXPECTED = "unexpected"


def recovery(out: Path) -> list[Figure]:
    """Kill every node but the plant once in a run at 10 Hz, then have another node announce itself as a publisher.

    Parameters
    ----------
    out
        Folder for the run.
    """
    seconds = EACH_S * (len(KILLED) + 2)
    pending = list(KILLED)
    context = rclpy.Context()
    announced_ns: list[int] = []
    unexpected: list[Node] = []  # a node that nobody holds is gone

    def disturb(tick: int, _ticks: int) -> None:
        due_s = EACH_S * (len(KILLED) - len(pending) + 1)
        if tick * 0.1 < due_s or announced_ns:
            return
        if pending:
            node_processes()[pending.pop(0)].kill()
            return
        rclpy.init(context=context, args=[], domain_id=domain[0])
        unexpected.append(rclpy.create_node(UNEXPECTED, namespace=NAMESPACE, context=context))
        unexpected[0].create_publisher(JointState, "controller/command", LOOP_QOS)
        announced_ns.append(time.time_ns())

    domain: list[int] = []
    scenario = load("nominal", [f"duration_s={seconds:g}", "references={}", "air={}", "faults=[]"])
    try:
        run = run_graph(scenario, out, mode="realtime", progress=disturb, say=lambda _: None, beside=domain.append)
    finally:
        for node in unexpected:
            node.destroy_node()
        context.try_shutdown()
    figures = [
        Figure(f"killed {restart.node}: back in service after", "s", restart.back_s - restart.died_s, BACK_BAR_S)
        for restart in run.restarts
    ]
    reported_s = (_first_report_ns(run.bag) - announced_ns[0]) / 1e9
    return [*figures, Figure("second publisher: reported after", "s", reported_s, REPORTED_BAR_S)]


def _first_report_ns(bag: Path) -> float:
    """Return when the bag's first report of the unexpected publisher was written."""
    for log_ns, data in read_raw(bag).messages["/diagnostics"]:
        for status in read_diagnostics(data):
            unexpected = BringupReport.read(status.values).strangers
            if status.name.endswith(f"/{BRINGUP}") and any(UNEXPECTED in line for line in unexpected):
                return log_ns
    return float("nan")
