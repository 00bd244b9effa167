"""The one place that touches what rclpy keeps to itself: where another release of it has to be looked at.

rclpy has no public way to tell its errors apart, to wait for a few subscriptions without an executor, to refuse a
transition that the present state does not have, or to let go of a life cycle's services.
"""

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

#: What rclpy raises when a call into the middleware fails, and when there are ROS arguments that it does not know.
RCLError: type[Exception] = rclpy_implementation.RCLError
UnknownROSArgsError: type[Exception] = rclpy_implementation.UnknownROSArgsError
WaitSet = rclpy_implementation.WaitSet


class ManagedNode(LifecycleNode):  # type: ignore[misc]
    """A lifecycle node that survives a wrong request and lets go of everything at its end."""

    @property
    def state(self) -> str:
        """Label of the life-cycle state."""
        return str(self._state_machine.current_state[1])

    def destroy_node(self) -> None:
        """Let go of everything in the middleware."""
        super().destroy_node()
        # rclpy forgets this one, and it holds the node: nobody would be told of its end, and shared memory would stay.
        self._state_machine.destroy_when_not_in_use()

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:
        """Refuse a transition that the present state does not have; in rclpy alone the exception ends the node."""
        if transition_id not in (number for number, *_ in self._state_machine.available_transitions):
            return TransitionCallbackReturn.FAILURE
        return super()._LifecycleNodeMixin__change_state(transition_id)
