"""Whose turn it is: a tick's measurements, then the command that answers them, as they come in.

For a node that needs both, such as the detector: the measurements of a tick and the command of the tick before.
Bookkeeping without ROS. Commands may be lost, come late, or overtake their own measurements; measurements may overtake
the command of the tick before.
"""

from collections.abc import Callable
from typing import Any

#: Stamp in ns, then the values of a tick.
Tick = tuple[int, *tuple[Any, ...]]


class Sequencer:
    """Calls `observe` and `close` in turn, once for each tick.

    Parameters
    ----------
    observe
        Called with stamp and values of a tick's measurements; `awaited_ns` is None unless the command of the tick
        before has not come.
    close
        Called with the command of the tick that was observed last.

    Attributes
    ----------
    observed_ns : stamp of the tick observed last; -1 before the first.
    awaited_ns : the same while its command has not come; None when it has.
    overtaken : ticks that were observed without the command of the one before.
    """

    def __init__(self, observe: Callable[..., None], close: Callable[..., None]) -> None:
        self._call_observe = observe
        self._close = close
        self.observed_ns = -1
        self.awaited_ns: int | None = None
        self.overtaken = 0
        self._early: Tick | None = None  # measurements that wait for the command of the tick before
        self._ahead: Tick | None = None  # a command that waits for its measurements

    def measured(self, time_ns: int, *values: Any) -> None:
        """Take the measurements of a tick; those that have overtaken a command wait for it, for one tick."""
        if self.awaited_ns is None:
            self._observe((time_ns, *values))
            return
        if self._early is not None:
            self.overtaken += 1  # that command is lost or very late: the observer goes on without
            self._observe(self._early)
        self._early = (time_ns, *values)

    def commanded(self, time_ns: int, *values: Any) -> None:
        """Take a command; one that has overtaken its measurements, as a replay's may, waits for them."""
        if self.awaited_ns is None:
            if time_ns > self.observed_ns:
                self._ahead = (time_ns, *values)
            return
        if time_ns < self.awaited_ns:
            return
        self.awaited_ns = None
        self._close(*values)
        if self._early is not None:
            early, self._early = self._early, None
            if time_ns >= early[0]:
                # The command of the tick before is lost, and this one answers the measurements that waited for it: it
                # closes their tick, too, or every tick from now on would wait for the command of the next one.
                self._ahead = (time_ns, *values)
            self._observe(early)

    def _observe(self, measured: Tick) -> None:
        self._call_observe(*measured)
        self.awaited_ns = self.observed_ns = measured[0]
        if self._ahead is not None:
            ahead, self._ahead = self._ahead, None
            self.commanded(*ahead)
