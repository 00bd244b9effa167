"""What the plant is asked to do stays physical: too cold or without superheat, the controller steps aside.

Below a lowest evaporator pressure the coil ices up and the compressor runs on next to nothing; the low-pressure switch
of an air conditioner opens there. Below a lowest superheat liquid may reach the compressor ("slugging"), and the
plant's gains change so much that a linear controller swings from limit to limit. In both cases the command goes, in a
ramp, to one at which the plant is known to recover: that of the operating point, with the valve closed somewhat
(superheat) or the compressor slowed down (pressure). When all has been well for a while the controller takes over
again.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from bringup.units import RPM

COLD = "evaporator pressure too low (freezing): compressor is slowed down"
DRY = "superheat too low (liquid to the compressor): valve is closed"


@dataclass(frozen=True)
class ProtectionLimits:
    """When to act, and how.

    Attributes
    ----------
    lowest_pressure_pa, lowest_superheat_k : float
        Below it for `confirm_s` the protection acts.
    pressure_margin_pa, superheat_margin_k : float
        When both are above the lowest value plus this for `release_s` it is over.
    confirm_s, release_s : float
    forget_s : float
        When it has to act again within this time, `release_s` doubles each time (`most_release_s` at most): a reference
        that cannot be had must not make the plant swing.
    most_release_s : float
    speed_rate_rad_s2, valve_rate_1_s : float
        How fast the command moves.
    speed_share, valve_share : float
        The compressor's speed when it is too cold, the valve's opening when the superheat is too low, as shares of the
        operating point's.
    """

    lowest_pressure_pa: float = 160e3
    lowest_superheat_k: float = 3.0
    pressure_margin_pa: float = 15e3
    superheat_margin_k: float = 5.0
    confirm_s: float = 0.3
    release_s: float = 10.0
    forget_s: float = 300.0
    most_release_s: float = 160.0
    speed_rate_rad_s2: float = 300.0 * RPM
    valve_rate_1_s: float = 0.1
    speed_share: float = 0.6
    valve_share: float = 0.8

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"protection: {name} is {value!r}; allowed: a number, not negative")
        for name in ("speed_share", "valve_share"):
            if getattr(self, name) > 1.0:
                raise ValueError(f"protection: {name} is {getattr(self, name)!r}; allowed: 0 to 1")


class Protection(NamedTuple):
    """The protection's state after a tick.

    Attributes
    ----------
    reason : str
        `COLD` or `DRY` while it acts, else empty.
    cold_s, dry_s : float
        For how long the pressure, the superheat has been too low.
    well_s : float
        For how long both have been well above.
    release_s : float
        For how long they must be.
    calm_s : float
        Time since it was over.
    """

    reason: str = ""
    cold_s: float = 0.0
    dry_s: float = 0.0
    well_s: float = 0.0
    release_s: float = 0.0
    calm_s: float = 0.0


IDLE = Protection()


def protect(
    state: Protection, pressure_pa: float, superheat_k: float, limits: ProtectionLimits, sample_time_s: float
) -> Protection:
    """One tick.

    Parameters
    ----------
    state
        After the tick before; `IDLE` at first.
    pressure_pa, superheat_k
        Measured in this tick.
    limits, sample_time_s

    Returns
    -------
    Protection
        `IDLE` itself when there is nothing to do.
    """
    is_cold, is_dry = pressure_pa < limits.lowest_pressure_pa, superheat_k < limits.lowest_superheat_k
    if state is IDLE and not (is_cold or is_dry):
        return state
    is_well = (
        pressure_pa >= limits.lowest_pressure_pa + limits.pressure_margin_pa
        and superheat_k >= limits.lowest_superheat_k + limits.superheat_margin_k
    )
    cold_s = state.cold_s + sample_time_s if is_cold else 0.0
    dry_s = state.dry_s + sample_time_s if is_dry else 0.0
    well_s = state.well_s + sample_time_s if is_well else 0.0
    reason, release_s, calm_s = state.reason, state.release_s, 0.0
    if dry_s >= limits.confirm_s or cold_s >= limits.confirm_s:
        reason = DRY if dry_s >= limits.confirm_s else COLD
        if not state.reason:
            release_s = min(2.0 * release_s, limits.most_release_s) if release_s else limits.release_s
    elif reason and well_s >= release_s:
        reason = ""
    elif not reason:
        calm_s = state.calm_s + sample_time_s
        if calm_s > limits.forget_s:
            return IDLE
    return Protection(reason, cold_s, dry_s, well_s, release_s, calm_s)


def protective_command(reason: str, rest: tuple[float, float], limits: ProtectionLimits) -> tuple[float, float]:
    """Where the command goes: compressor speed [rad/s] and valve opening [0..1].

    Parameters
    ----------
    reason
        `COLD` or `DRY`.
    rest
        Command of the operating point, same units.
    limits
    """
    speed, opening = rest
    return (speed, limits.valve_share * opening) if reason == DRY else (limits.speed_share * speed, opening)
