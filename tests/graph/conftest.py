"""Real processes over real DDS, and what helps to look at them."""

import os
from collections.abc import Iterator
from typing import Any, Self

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from bringup.ros.graph import GraphRun, run_graph
from bringup.ros.processes import ros_environment
from bringup.scenario import Scenario, check

#: Two faults, noise and a moving reference within 12 s: every part of the loop has something to do.
SHORT = {
    "name": "short",
    "duration_s": 12.0,
    "references": {"evaporator_pressure_kpa": [{"at_s": 1, "to": 1.0, "ramp_s": 4}]},
    "air": {"mass_flow_percent": [{"at_s": 2, "to": 3.0}]},
    "faults": [
        {"kind": "compressor_speed", "size_rpm": 40, "onset_s": 2},
        {"kind": "evaporator_pressure", "size_kpa": 1, "onset_s": 6, "profile": "sine", "period_s": 3},
    ],
    "noise": {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02, "seed": 7},
}


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return check(SHORT)


@pytest.fixture(scope="session")
def run(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> GraphRun:
    """One lockstep run that many tests look at."""
    return run_graph(scenario, tmp_path_factory.mktemp("run"))


class Operator:
    """Someone with the `ros2` command: a ROS context of its own beside the running graph."""

    def __init__(self) -> None:
        os.environ.update(ros_environment())
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self._node = rclpy.create_node("operator", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def call(self, type_: Any, name: str, request: Any) -> Any:
        client = self._node.create_client(type_, name)
        assert client.wait_for_service(timeout_sec=10)
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, timeout_sec=10)
        assert future.done(), f"{name} did not answer"
        return future.result()

    def set(self, **values: Any) -> list[Any]:
        parameters = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
        request = SetParameters.Request(parameters=[parameter.to_parameter_msg() for parameter in parameters])
        return list(self.call(SetParameters, "/ac/fault_injector/set_parameters", request).results)

    def switch(self, fault: str, on: bool) -> Any:
        return self.call(SetBool, f"/ac/fault_injector/{fault}", SetBool.Request(data=on))

    def change(self, node: str, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert self.call(ChangeState, f"/ac/{node}/change_state", request).success

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def operator() -> Iterator[Operator]:
    with Operator() as someone:
        yield someone
