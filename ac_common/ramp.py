"""A change from what the scenario plays, made while the loop runs: one number a tick, a step or a straight line."""

import math


class LiveOffset:
    """One quantity's offset, in the quantity's own unit.

    Parameters
    ----------
    offset : float
        What it is from the first tick on.
    """

    def __init__(self, offset: float = 0.0) -> None:
        self._start = self._target = self._now = offset
        self._ramp_s = 0.0
        self._began_s = math.nan

    def change(self, target: float, ramp_s: float = 0.0) -> None:
        """Go from where it is to `target` from the next tick on, in a straight line that takes `ramp_s`; 0: a step."""
        self._start, self._target, self._ramp_s = self._now, target, ramp_s
        self._began_s = math.nan

    def value(self, time_s: float) -> float:
        """Return the offset at this tick; call it once a tick.

        Parameters
        ----------
        time_s : float
            Time of the tick; the first call after `change` is when the change begins.
        """
        if self._now == self._target:
            return self._now
        if math.isnan(self._began_s):
            self._began_s = time_s
        since = time_s - self._began_s
        if since >= self._ramp_s:
            self._now = self._target
        else:
            self._now = self._start + (self._target - self._start) * since / self._ramp_s
        return self._now
