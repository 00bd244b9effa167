"""Somebody who works with a running graph, as with the `ros2` command."""

import os
from contextlib import ExitStack
from typing import Any, Self

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from ac_ros_common.client_node import client_node
from bringup.launch.processes import ros_environment


class Operator:
    """A ROS context of its own beside the running graph."""

    def __init__(self) -> None:
        os.environ.update(ros_environment())
        self._stack = ExitStack()
        self._node, self._executor = self._stack.enter_context(client_node("operator"))

    def call(self, type_: Any, name: str, request: Any) -> Any:
        client = self._node.create_client(type_, name)
        assert client.wait_for_service(timeout_sec=10)
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, timeout_sec=10)
        assert future.done(), f"{name} did not answer"
        return future.result()

    def set(self, node: str, **values: Any) -> list[Any]:
        parameters = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
        request = SetParameters.Request(parameters=[parameter.to_parameter_msg() for parameter in parameters])
        return list(self.call(SetParameters, f"/ac/{node}/set_parameters", request).results)

    def switch(self, fault: str, on: bool) -> Any:
        return self.call(SetBool, f"/ac/fault_injector/{fault}", SetBool.Request(data=on))

    def change(self, node: str, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert self.call(ChangeState, f"/ac/{node}/change_state", request).success

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
