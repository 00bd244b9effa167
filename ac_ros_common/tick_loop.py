"""The loop of a node: its ticks' messages as they come in, the ticks that are due, and a deadline of the node's own."""

import math
import time
from collections.abc import Callable, Mapping, Sequence

from rclpy.context import Context

from ac_common.topics import BY_NAME, Topic
from ac_ros_common.inputs import LoopInputs, Subscriptions
from ac_ros_common.realtime import sleep_until
from ac_ros_common.tick_sync import TickSet, Timeline, WallClockSet

#: Services, timers and events get their turn so often while the loop runs.
OTHERS_PERIOD_S = 0.02
#: They wait for the end of a tick, but not longer than this when there is none.
OTHERS_PATIENCE_S = 0.1
#: How long their turn may take; a deadline that is nearer comes first.
OTHERS_TAKE_S = 0.003
#: The last bit of the time to a deadline is slept through on a timer that is more exact than the middleware's.
DEADLINE_MARGIN_S = 0.0005


class TickLoop:
    """Takes the loop's messages and has the node act on each tick of which all have come, or which is due.

    Parameters
    ----------
    context : Context
    rejected : callable
        See `LoopInputs`.
    on_deadline : callable
        Called at `deadline_s`.

    Attributes
    ----------
    deadline_s : float
        Monotonic time at which `on_deadline` is due; inf: never.
    """

    def __init__(
        self, context: Context, rejected: Callable[[str, str, str], None], on_deadline: Callable[[], None]
    ) -> None:
        self.inputs = LoopInputs(rejected)
        self.subscriptions = Subscriptions(context, self.inputs.take)
        self._on_deadline = on_deadline
        self.deadline_s = math.inf

    def add(
        self,
        topics: Sequence[str],
        act: Callable[..., None],
        period_ns: int | None,
        patience: float,
        holds_s: Mapping[str, float],
        optional: tuple[str, ...],
        on_missed_inputs: Callable[[int], None] | None,
    ) -> tuple[Topic, ...]:
        """Expect the messages of a tick, and return their topics, to be subscribed to in this order.

        In lockstep `period_ns` is None, and a tick waits for all its messages. On the wall clock it goes on when it is
        due: see `LoopNode.on_tick` and `WallClockSet` for the rest.
        """
        described = tuple(BY_NAME[name] for name in topics)
        if period_ns is None:
            self.inputs.add(TickSet(described, act))
            return described
        if self.inputs.timeline is None:
            self.inputs.timeline = Timeline(period_ns)
        holds = {
            name: None if math.isinf(hold_s) else math.ceil(hold_s * 1e9 / period_ns)
            for name, hold_s in holds_s.items()
        }
        patience_ns = int(patience * period_ns)
        self.inputs.add(
            WallClockSet(described, act, self.inputs.timeline, patience_ns, holds, optional, on_missed_inputs)
        )
        return described

    def clear(self) -> None:
        """Forget whatever came before now."""
        self.subscriptions.arrived()
        self.inputs.clear()

    def serve(self, goes_on: Callable[[], bool]) -> bool:
        """Serve the loop until everything else is due; return whether there is time for that before a deadline.

        That is after a tick: between its part in this tick and the next one a node holds nobody up.
        """
        due_s = time.monotonic() + OTHERS_PERIOD_S
        latest_s = due_s + OTHERS_PATIENCE_S
        while goes_on() and (now := time.monotonic()) < latest_s:
            if self.deadline_s - now < DEADLINE_MARGIN_S:
                sleep_until(self.deadline_s)
                self._on_deadline()
            tick_due_s = self.inputs.due_s()
            if tick_due_s <= now:
                self.subscriptions.take()  # what has come meanwhile comes first
                self.inputs.act_on_due()
                tick_due_s = self.inputs.due_s()
            until_s = min(latest_s, self.deadline_s - DEADLINE_MARGIN_S, tick_due_s)
            tick_is_over = self.subscriptions.wait(until_s - now, self.inputs.awaited())
            if tick_is_over and time.monotonic() >= due_s:
                break
        return min(self.deadline_s, self.inputs.due_s()) - time.monotonic() > OTHERS_TAKE_S
