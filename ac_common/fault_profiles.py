"""How a fault grows over time: unit profiles of a fault, over all ticks of a run or for one tick of a live fault.

A profile is 0 before its onset and scaled by the fault's size afterwards, so one set of shapes serves all faults.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

PROFILES = ("step", "ramp", "sine", "drift", "intermittent", "random_walk", "noise")

#: Of a sensor only: its reading stays what it was at the onset, whatever that makes of it. It has no size.
STUCK = "stuck"
SENSOR_PROFILES = (*PROFILES, STUCK)

#: Which extra key each profile takes (all of them take onset and end).
PROFILE_KEYS: dict[str, tuple[str, ...]] = {
    "step": (),
    "ramp": ("rise_s",),
    "sine": ("period_s",),
    "drift": ("time_constant_s",),
    "intermittent": ("period_s", "duty_percent"),
    "random_walk": ("time_constant_s", "seed"),
    "noise": ("seed",),
    STUCK: (),
}


#: Times of ticks are sums and differences of decimal numbers: they are off by less than this, s.
_ROUNDING_S = 1e-6


def is_there(since_s: Any, period_s: float, duty_percent: float) -> Any:
    """Return whether an intermittent fault is there, this long after its onset; a number or an array.

    A tick at the end of a period belongs to the next one, also when its time was rounded to just before it.
    """
    within = (since_s + _ROUNDING_S) % period_s
    return within < period_s * duty_percent / 100.0


def grown(
    since_s: Any,
    profile: str,
    *,
    rise_s: float = 60.0,
    period_s: float = 60.0,
    time_constant_s: float = 100.0,
    duty_percent: float = 50.0,
) -> Any:
    """Return how much of a fault of size 1 there is, this long after its onset; a number or an array.

    The parameters are those of `unit_profile`.

    Raises
    ------
    ValueError
        When `profile` is not one of `PROFILES` that time alone decides: all but ``random_walk`` and ``noise``.
    """
    if profile == "step":
        return np.ones_like(since_s)
    if profile == "ramp":
        return np.clip(since_s / rise_s, 0.0, 1.0)
    if profile == "sine":
        return np.sin(2.0 * np.pi * since_s / period_s)
    if profile == "drift":
        return 1.0 - np.exp(-np.maximum(since_s, 0.0) / time_constant_s)
    if profile == "intermittent":
        return np.asarray(is_there(since_s, period_s, duty_percent), dtype=np.float64)
    msg = f"fault profile {profile!r} is unknown; allowed: {', '.join(PROFILES)}"
    raise ValueError(msg)


def unit_profile(
    time_s: NDArray[np.float64],
    profile: str,
    onset_s: float,
    end_s: float | None = None,
    *,
    rise_s: float = 60.0,
    period_s: float = 60.0,
    time_constant_s: float = 100.0,
    duty_percent: float = 50.0,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Return a fault of size 1 over time.

    Parameters
    ----------
    time_s
        Ticks, shape (K,), equally spaced, s.
    profile
        ``step``: 1 from the onset. ``ramp``: linear from 0 to 1 within `rise_s`, then 1. ``sine``: amplitude 1,
        `period_s`, 0 at the onset. ``drift``: ``1 - exp(-(t - onset) / time_constant_s)``, an ageing sensor.
        ``intermittent``: 1 during the first `duty_percent` of every `period_s`, else 0 (a loose contact); see
        `is_there`.
        ``random_walk``: Gaussian steps, standard deviation 1 after `time_constant_s`, from `seed`.
        ``noise``: white Gaussian, standard deviation 1, from `seed`.
    onset_s, end_s
        The fault is 0 before `onset_s` and from `end_s` on (None: it stays).

    Returns
    -------
    NDArray
        Shape (K,).

    Raises
    ------
    ValueError
        When `profile` is none of `PROFILES`.
    """
    since = time_s - onset_s
    if profile == "random_walk":
        tick_s = time_s[1] - time_s[0] if len(time_s) > 1 else 0.0
        steps = np.random.default_rng(seed).normal(size=len(time_s)) * np.sqrt(tick_s / time_constant_s)
        shape = np.cumsum(np.where(since > 0.0, steps, 0.0))
    elif profile == "noise":
        shape = np.random.default_rng(seed).normal(size=len(time_s))
    else:
        times = {"rise_s": rise_s, "period_s": period_s, "time_constant_s": time_constant_s}
        shape = grown(since, profile, **times, duty_percent=duty_percent)
    acts = time_s >= onset_s
    if end_s is not None:
        acts &= time_s < end_s
    return np.where(acts, shape, 0.0)
