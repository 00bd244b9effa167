"""What the actuators do when no command comes: hold the last one for a while, then go to the operating point's.

The rest command is safe because the plant, stable by itself, is known to rest there with superheat, at any air side
near the operating point's; standing still with an open valve would flood the evaporator instead.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ac_common.units import RPM

Vector = NDArray[np.float64]

#: How long the actuators hold the last command, s.
COMMAND_HOLD_S = 1.0
#: How fast they then go to the safe command: compressor [rad/s^2], valve [1/s].
SAFE_RATE = (50.0 * RPM, 0.01)


def towards(value: Vector, target: Vector, sample_time_s: float, rate: tuple[float, float] = SAFE_RATE) -> Vector:
    """Return `value` after one tick on its way to `target` at `rate`."""
    stride = np.array(rate) * sample_time_s
    moved: Vector = value + np.clip(target - value, -stride, stride)
    return moved


class CommandHold:
    """The actuators' set point, tick by tick, whether a command comes or not.

    Parameters
    ----------
    safe : sequence of float, length 2
        The safe command: compressor speed [rad/s], valve opening [0..1]; the set point before any command, too.
    sample_time_s : float
    hold_s : float
        How long the last command is held.

    Attributes
    ----------
    setpoint : ndarray, shape (2,)
    silent_ticks : int
        Ticks without a command since the last one.
    """

    def __init__(self, safe: Sequence[float] | Vector, sample_time_s: float, hold_s: float = COMMAND_HOLD_S) -> None:
        self._safe = np.array(safe, dtype=np.float64)
        self._sample_time_s = sample_time_s
        self._hold_s = hold_s
        self.setpoint = self._safe.copy()
        self.silent_ticks = 0

    @property
    def is_over(self) -> bool:
        """Whether the last command has been held for long enough."""
        return self.silent_ticks * self._sample_time_s > self._hold_s

    def commanded(self, command: Sequence[float] | Vector) -> None:
        """Follow the command of this tick."""
        self.setpoint[:] = command
        self.silent_ticks = 0

    def silent(self) -> Vector:
        """Set point of a tick without a command."""
        self.silent_ticks += 1
        if self.is_over:
            self.setpoint = towards(self.setpoint, self._safe, self._sample_time_s)
        return self.setpoint
