"""Ctrl-C and SIGTERM: the first ends what is going on, the second is told that this is under way, the third leaves."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

from ac_ros_common.installation import INTERRUPTED

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def orderly_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt at the first signal alone: what stops nodes and closes bags is not cut off by the next.

    The third one ends this process at once; its nodes end with it, and the recorder closes its bag. Within another such
    context this does nothing.
    """
    before = [signal.getsignal(number) for number in SIGNALS]
    if any(isinstance(handler, _Handler) for handler in before):
        yield
        return
    handler = _Handler()
    for number in SIGNALS:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, earlier in zip(SIGNALS, before, strict=True):
            signal.signal(number, earlier)


class _Handler:
    """What the signals do, one after another."""

    def __init__(self) -> None:
        self._numbers = count(1)

    def __call__(self, number: int, _frame: object) -> None:
        nth = next(self._numbers)
        if nth == 1:
            raise KeyboardInterrupt(signal.Signals(number).name)
        if nth > 2:
            os._exit(INTERRUPTED)
        os.write(2, b"acftc: is ending; once more leaves at once\n")
