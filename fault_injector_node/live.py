"""A fault that is started and stopped while the loop runs: one number a tick, the same shapes as in a scenario."""

import math
from dataclasses import dataclass

import numpy as np

from ac_common.fault_profiles import SENSOR_PROFILES, STUCK, grown


@dataclass(frozen=True)
class Shape:
    """How a fault grows; what the keys mean is said in `ac_common.fault_profiles.unit_profile`.

    Attributes
    ----------
    size : float
        SI.
    """

    profile: str = "step"
    size: float = 0.0
    rise_s: float = 60.0
    period_s: float = 60.0
    time_constant_s: float = 100.0
    duty_percent: float = 50.0
    seed: int = 0


class LiveFault:
    """One fault; zero until it is started.

    Parameters
    ----------
    sample_time_s : float
        Time between two ticks, for the random walk.
    """

    def __init__(self, sample_time_s: float) -> None:
        self._sample_time_s = sample_time_s
        self._shape: Shape | None = None
        self._onset_s = math.nan
        self._walk = 0.0
        self._random = np.random.default_rng(0)

    @property
    def is_active(self) -> bool:
        """Whether the fault has been started and not stopped."""
        return self._shape is not None

    @property
    def is_stuck(self) -> bool:
        """Whether the reading is to stay what it is."""
        return self._shape is not None and self._shape.profile == STUCK

    def start(self, shape: Shape) -> None:
        """Begin at the next tick, from its beginning also when it is running already."""
        if shape.profile not in SENSOR_PROFILES:
            msg = f"fault profile {shape.profile!r} is unknown; allowed: {', '.join(SENSOR_PROFILES)}"
            raise ValueError(msg)
        self._shape = shape
        self._onset_s = math.nan
        self._walk = 0.0
        self._random = np.random.default_rng(shape.seed)

    def change(self, shape: Shape) -> None:
        """Go on with another shape, if the fault is running."""
        if self._shape is not None:
            self._shape = shape

    def stop(self) -> None:
        """End at the next tick."""
        self._shape = None

    def value(self, time_s: float) -> float:
        """Return the fault at this tick, in the unit of its size; call it once a tick. One that is stuck has no size.

        Parameters
        ----------
        time_s : float
            Time of the tick; the first call after `start` is the onset.
        """
        shape = self._shape
        if shape is None or shape.profile == STUCK:
            return 0.0
        if math.isnan(self._onset_s):
            self._onset_s = time_s
        since = time_s - self._onset_s
        if shape.profile == "random_walk":  # standard deviation 1 after the time constant
            draw = self._random.normal() * math.sqrt(self._sample_time_s / shape.time_constant_s)
            self._walk += draw if since > 0.0 else 0.0
            return shape.size * self._walk
        if shape.profile == "noise":
            return shape.size * float(self._random.normal())
        times = {"rise_s": shape.rise_s, "period_s": shape.period_s, "time_constant_s": shape.time_constant_s}
        return shape.size * float(grown(since, shape.profile, **times, duty_percent=shape.duty_percent))
