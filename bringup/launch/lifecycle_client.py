"""Requests to nodes: transitions of the life cycle, and parameters."""

import time
from collections.abc import Iterable, Mapping
from typing import Any, Self

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from ac_common.topics import NAMESPACE

#: Parameters that were not answered are set again after this, s.
ASK_AGAIN_S = 5.0


class LifecycleClient:
    """Requests transitions, once each until it is forgotten, as soon as the node's service is there."""

    def __init__(self, node: Any, names: Iterable[str]) -> None:
        self._clients = {name: node.create_client(ChangeState, f"{NAMESPACE}/{name}/change_state") for name in names}
        self._replies: dict[tuple[str, int], Any] = {}

    def is_managed(self, name: str) -> bool:
        """Whether a node has a life cycle, as far as is known by now."""
        return bool(self._clients[name].service_is_ready())

    def forget(self, names: Iterable[str], transition: int) -> None:
        """Forget what nodes have answered to a transition: it can be requested again."""
        for name in names:
            self._replies.pop((name, transition), None)

    def request(self, name: str, transition: int) -> None:
        """Request a transition, unless that has been done or the service is not there yet."""
        if (name, transition) not in self._replies and self.is_managed(name):
            message = ChangeState.Request(transition=Transition(id=transition))
            self._replies[name, transition] = self._clients[name].call_async(message)

    def has_answered(self, name: str, transition: int) -> bool:
        """Whether a node has answered, whatever it was."""
        reply = self._replies.get((name, transition))
        return reply is not None and bool(reply.done())

    def has_refused(self, name: str, transition: int) -> bool:
        """Whether a node has answered that it could not."""
        return self.has_answered(name, transition) and not self._replies[name, transition].result().success


class ParameterRequest:
    """Parameters of a node to be set, all of them or none; a context manager."""

    def __init__(self, node: Any, name: str, values: Mapping[str, Any]) -> None:
        self._node = node
        self._client = node.create_client(SetParametersAtomically, f"{NAMESPACE}/{name}/set_parameters_atomically")
        parameters = [Parameter(key, value=value).to_parameter_msg() for key, value in values.items()]
        self._message = SetParametersAtomically.Request(parameters=parameters)
        self._replies: list[Any] = []
        self._asked_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._node.destroy_client(self._client)

    def is_possible(self) -> bool:
        """Whether the node's service is there."""
        return bool(self._client.service_is_ready())

    def is_answered(self) -> bool:
        """Ask, again when it takes long, and tell whether the node has answered."""
        now_s = time.monotonic()
        # A node that has not found this client yet answers into the void.
        if not self._replies or now_s - self._asked_s >= ASK_AGAIN_S:
            self._asked_s = now_s
            self._replies.append(self._client.call_async(self._message))
        return any(reply.done() for reply in self._replies)

    @property
    def refusal(self) -> str | None:
        """Return why the node has refused; None when it has not."""
        result = next(reply for reply in self._replies if reply.done()).result().result
        return None if result.successful else str(result.reason)
