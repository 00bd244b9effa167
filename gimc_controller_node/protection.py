"""What the plant is asked to do stays physical: caps on the command when it is too cold or the superheat is gone.

Below a lowest evaporator pressure the coil ices up and the compressor runs on next to nothing; the low-pressure switch
of an air conditioner opens there. Below a lowest superheat liquid may reach the compressor ("slugging"). What helps is
known without a model: less speed against the one, less valve opening against the other. So while the pressure
(superheat) is below its lowest value, a cap on the speed (opening) comes down from what the command is, in a ramp; when
it is well above, the cap goes up again, slowly, and when the command has been below it for a while it is gone. This is
the override (selector) control of process engineering: the controller stays in the loop, and may do more of the same;
its anti-windup (see `Controller`) takes care of the rest.

A reference that low is not even tried: the controller would be driven there again and again.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.units import RPM

COLD = "evaporator pressure too low (freezing): compressor speed is capped"
DRY = "superheat too low (liquid to the compressor): valve opening is capped"


class Guard(NamedTuple):
    """Of one cap: the margin above which it goes up again, the least that it leaves, and how fast it comes down."""

    margin: float
    least: float
    rate: float


@dataclass(frozen=True)
class ProtectionLimits:
    """When to act, and how.

    Attributes
    ----------
    lowest_pressure_pa, lowest_superheat_k : float
        Below it for `confirm_s` the protection acts.
    pressure_margin_pa, superheat_margin_k : float
        A cap goes up again while what it protects is above its lowest value plus this; references are kept above it.
    confirm_s : float
    release_s : float
        A cap is gone when the command has been below it for so long.
    speed_rate_rad_s2, opening_rate_1_s : float
        How fast the caps come down; up they go at `UP` times that.
    least_speed_rad_s, least_opening : float
        What the caps leave in any case.
    """

    lowest_pressure_pa: float = 160e3
    lowest_superheat_k: float = 3.0
    pressure_margin_pa: float = 15e3
    superheat_margin_k: float = 5.0
    confirm_s: float = 0.3
    release_s: float = 10.0
    speed_rate_rad_s2: float = 100.0 * RPM
    opening_rate_1_s: float = 0.02
    least_speed_rad_s: float = 600.0 * RPM
    least_opening: float = 0.05

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"protection: {name} is {value!r}; allowed: a number, not negative")

    @property
    def speed_guard(self) -> Guard:
        """Of the cap on the speed: Pa, rad/s, rad/s^2."""
        return Guard(self.pressure_margin_pa, self.least_speed_rad_s, self.speed_rate_rad_s2)

    @property
    def opening_guard(self) -> Guard:
        """Of the cap on the opening: K, 0..1, 1/s."""
        return Guard(self.superheat_margin_k, self.least_opening, self.opening_rate_1_s)

    @property
    def lowest_reference(self) -> NDArray[np.float64]:
        """Lowest pressure and superheat that the plant may be asked for [Pa, K]."""
        return np.array(
            [self.lowest_pressure_pa + self.pressure_margin_pa, self.lowest_superheat_k + self.superheat_margin_k]
        )


ON_THE_BELT = ProtectionLimits(lowest_pressure_pa=0.0)
"""Limits where an engine turns the compressor: no cap on its speed would be heard, and p_e is nobody's to hold."""

UP = 0.2
"""How fast a cap goes up, as a part of how fast it comes down."""


class Cap(NamedTuple):
    """A cap on one command after a tick.

    Attributes
    ----------
    value : float
        The cap; inf when there is none.
    low_s : float
        For how long what it protects has been too low.
    free_s : float
        For how long the command has been below the cap.
    """

    value: float = math.inf
    low_s: float = 0.0
    free_s: float = 0.0


FREE = Cap()


class Protection(NamedTuple):
    """The caps on speed [rad/s] and opening [0..1] after a tick."""

    speed: Cap = FREE
    opening: Cap = FREE

    @property
    def reason(self) -> str:
        """`COLD`, `DRY`, both, or empty: which caps there are."""
        return "; ".join(why for cap, why in ((self.speed, COLD), (self.opening, DRY)) if cap.value < math.inf)


IDLE = Protection()


def protect(
    state: Protection,
    measured: tuple[float, float],
    command: tuple[float, float],
    limits: ProtectionLimits,
    sample_time_s: float,
) -> Protection:
    """Return the caps after one tick.

    Parameters
    ----------
    state
        After the tick before; `IDLE` at first.
    measured
        Evaporator pressure [Pa] and superheat [K] in this tick.
    command
        Compressor speed [rad/s] and valve opening [0..1] of the tick before.
    limits, sample_time_s

    Returns
    -------
    Protection
        `IDLE` itself when there is nothing to do.
    """
    pressure, superheat = measured
    if state is IDLE and pressure >= limits.lowest_pressure_pa and superheat >= limits.lowest_superheat_k:
        return state
    speed = _moved(
        state.speed, pressure - limits.lowest_pressure_pa, command[0], limits.speed_guard, limits, sample_time_s
    )
    opening = _moved(
        state.opening, superheat - limits.lowest_superheat_k, command[1], limits.opening_guard, limits, sample_time_s
    )
    return IDLE if speed == opening == FREE else Protection(speed, opening)


def _moved(cap: Cap, above: float, command: float, guard: Guard, limits: ProtectionLimits, sample_time_s: float) -> Cap:
    """Return a cap after one tick; `above` is by how much what it protects is above its lowest value."""
    stride = guard.rate * sample_time_s
    low_s = cap.low_s + sample_time_s if above < 0.0 else 0.0
    value = cap.value
    if low_s > limits.confirm_s - 0.5 * sample_time_s:
        value = max(min(value, command) - stride, min(guard.least, command))
    elif above > guard.margin:
        value += UP * stride
    if value == math.inf:
        return Cap(low_s=low_s)
    free_s = cap.free_s + sample_time_s if command < value - stride else 0.0
    return FREE if free_s > limits.release_s and not low_s else Cap(value, low_s, free_s)
