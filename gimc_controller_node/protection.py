"""What the plant is asked to do stays physical: caps on the command when pressures or superheat are not.

Below a lowest evaporator pressure the coil ices up and the compressor runs on next to nothing; the low-pressure switch
of an air conditioner opens there. Above a highest condenser pressure the limiter takes the compressor off load: more
speed is then more power for no more cooling. Below a lowest superheat liquid may reach the compressor ("slugging").
What helps is known without a model: less speed against the first two, less valve opening against the third. So while a
pressure (superheat) is beyond its limit, a cap on the speed (opening) comes down from what the command is, in a ramp;
when it is well within, the cap goes up again, slowly, and when the command has been below it for a while it is gone.
This is the override (selector) control of process engineering: the controller stays in the loop, and may do more of the
same; its anti-windup (see `Controller`) takes care of the rest.

A reference that low is not even tried: the controller would be driven there again and again.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.units import RPM
from gimc_controller_node.compiled import Array, jit

COLD = "evaporator pressure too low (freezing): compressor speed is capped"
HIGH = "condenser pressure too high: compressor speed is capped"
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
    highest_head_pa : float
        The same for the condenser pressure above it.
    pressure_margin_pa, superheat_margin_k, head_margin_pa : float
        A cap goes up again while what it protects is within its limit by more than this; references are kept so, too.
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
    highest_head_pa: float = 2.9e6
    pressure_margin_pa: float = 15e3
    superheat_margin_k: float = 5.0
    head_margin_pa: float = 100e3
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
        """Of the cap on the speed for the evaporator pressure: Pa, rad/s, rad/s^2."""
        return Guard(self.pressure_margin_pa, self.least_speed_rad_s, self.speed_rate_rad_s2)

    @property
    def head_guard(self) -> Guard:
        """Of the cap on the speed for the condenser pressure: Pa, rad/s, rad/s^2."""
        return Guard(self.head_margin_pa, self.least_speed_rad_s, self.speed_rate_rad_s2)

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


NO_HIGHEST_HEAD_PA = 1.0e7
"""`ProtectionLimits.highest_head_pa` where no condenser pressure is too high."""


def limits_for(*, has_belt: bool, measures_head: bool) -> ProtectionLimits:
    """Return the limits of a loop.

    Where an engine turns the compressor no cap on its speed would be heard, and p_e is nobody's to hold; without a
    sensor of the condenser pressure there is nothing to go by.
    """
    lowest_pa = 0.0 if has_belt else ProtectionLimits.lowest_pressure_pa
    head_pa = ProtectionLimits.highest_head_pa if measures_head and not has_belt else NO_HIGHEST_HEAD_PA
    return ProtectionLimits(lowest_pressure_pa=lowest_pa, highest_head_pa=head_pa)


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
    """The caps on speed [rad/s] and opening [0..1] after a tick; `head` is one on the speed, too."""

    speed: Cap = FREE
    opening: Cap = FREE
    head: Cap = FREE

    @property
    def fastest(self) -> float:
        """Highest speed that is allowed, rad/s."""
        return min(self.speed.value, self.head.value)

    @property
    def reason(self) -> str:
        """`COLD`, `HIGH`, `DRY`, some of them, or empty: which caps there are."""
        return reason_for(sum(number for number, cap in zip(CAPPED, self, strict=True) if cap.value < math.inf))


CAPPED = 1, 4, 2
"""Numbers of the caps on the speed, the opening, and for the head; `reason_for` takes the sum of those there are."""


def reason_for(capped: int) -> str:
    """Return why there are the caps of such a sum."""
    return "; ".join(why for number, why in zip((1, 2, 4), (COLD, HIGH, DRY), strict=True) if capped & number)


IDLE = Protection()


def protect(
    state: Protection,
    measured: tuple[float, float, float],
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
        Evaporator pressure [Pa], superheat [K] and condenser pressure [Pa] in this tick; 0 for a condenser pressure
        that is not measured.
    command
        Compressor speed [rad/s] and valve opening [0..1] of the tick before.
    limits, sample_time_s

    Returns
    -------
    Protection
        `IDLE` itself when there is nothing to do.
    """
    pressure, superheat, head = measured
    within = pressure >= limits.lowest_pressure_pa and superheat >= limits.lowest_superheat_k
    if state is IDLE and within and head <= limits.highest_head_pa:
        return state
    caps = np.array(state)
    move_caps(caps, constants_of(limits, sample_time_s), *measured, *command)
    return protection_of(caps)


def protection_of(caps: Array) -> Protection:
    """Return the caps as `protect` does, of the array that `move_caps` moves."""
    protection = Protection(*(Cap(*cap) for cap in caps.tolist()))
    return IDLE if protection == IDLE else protection


@cache
def constants_of(limits: ProtectionLimits, sample_time_s: float) -> NDArray[np.float64]:
    """Return what `move_caps` needs to know: of the three caps a row each of margin, least and stride, then limits."""
    guards = limits.speed_guard, limits.opening_guard, limits.head_guard
    lowest, driest, highest = limits.lowest_pressure_pa, limits.lowest_superheat_k, limits.highest_head_pa
    rows = [(*guard[:2], guard.rate * sample_time_s) for guard in guards]
    waits = limits.confirm_s - 0.5 * sample_time_s, limits.release_s, sample_time_s
    return np.array([*rows, (lowest, driest, highest), waits])


@jit
def move_caps(
    caps: Array, constants: Array, pressure: float, superheat: float, head: float, speed: float, opening: float
) -> int:
    """Move the caps by one tick, and return the sum of `CAPPED` of those that there are.

    Parameters
    ----------
    caps : (3, 3) array
        The fields of `Protection`, each with those of `Cap`.
    constants : (5, 3) array
        From `constants_of`.
    pressure, superheat, head, speed, opening
        As `measured` and `command` of `protect`.
    """
    limits, waits, capped = constants[3], constants[4], 0
    for i in range(3):
        cap, guard = caps[i], constants[i]
        above = pressure - limits[0] if i == 0 else superheat - limits[1] if i == 1 else limits[2] - head
        command, stride = opening if i == 1 else speed, guard[2]
        low_s = cap[1] + waits[2] if above < 0.0 else 0.0
        value, free_s = cap[0], 0.0
        if low_s > waits[0]:
            value = max(min(value, command) - stride, min(guard[1], command))
        elif above > guard[0]:
            value += UP * stride
        if value < math.inf:
            free_s = cap[2] + waits[2] if command < value - stride else 0.0
            if free_s > waits[1] and low_s == 0.0:
                value, free_s = math.inf, 0.0
            else:
                capped += CAPPED[i]
        cap[0], cap[1], cap[2] = value, low_s, free_s
    return capped
