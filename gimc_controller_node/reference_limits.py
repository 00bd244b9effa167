"""References that the plant can follow: at least what protects it, at most what the inlet air allows.

The refrigerant cannot leave the evaporator warmer than the air that enters it, and near it the valve is all but shut:
`SH <= T_air - T_sat(p_e) - approach`. Where that leaves less than the lowest superheat, p_e has to be lower.
"""

import math

import numpy as np

from ac_common.compiled import ready
from ac_plant_node.saturation import saturation_curve, slope_on, temperature_on
from gimc_controller_node.compiled import Array, jit
from gimc_controller_node.controller import NO_APPROACH_K
from gimc_controller_node.protection import ProtectionLimits

TOO_DRY = "superheat reference beyond what the inlet air allows: capped"
TOO_WARM = "pressure reference beyond what the inlet air allows: capped"
RAISED, WARM, DRY, BOUNDS = 1, 2, 4, 8
"""Which bounds act, for compiled code: the sum of these, which is below the last number."""
_ZERO_C = 273.15


@jit
def bounds(
    curve: Array, lowest_pressure: float, driest: float, approach_k: float,
    pressure: float, superheat: float, air_c: float,
) -> tuple[float, float, int]:  # fmt: skip
    """Return both references within their bounds, and which act; an empty curve or an `air_c` of nan bounds nothing."""
    acts = 0
    if pressure < lowest_pressure or superheat < driest:
        pressure, superheat = max(pressure, lowest_pressure), max(superheat, driest)
        acts = RAISED
    if curve.size > 0 and not math.isnan(air_c):
        outlet = air_c + _ZERO_C - approach_k
        highest = outlet - temperature_on(curve, pressure)
        if highest < driest and pressure > lowest_pressure:
            pressure = max(_pressure_at(curve, outlet - driest, pressure), lowest_pressure)
            highest = driest
            acts += WARM
        if superheat > max(highest, driest):
            superheat = max(highest, driest)
            acts += DRY
    return pressure, superheat, acts


class ReferenceLimits:
    """Bounds of the references of p_e [Pa] and SH [K], and what is said when one acts.

    Parameters
    ----------
    limits : ProtectionLimits
    approach_k : float
        As in `ControllerDesign`.

    Attributes
    ----------
    curve : ndarray
    constants : tuple of float
        The first arguments of `bounds`.
    words : list of str
        What is said when bounds act, by their sum.
    """

    def __init__(self, limits: ProtectionLimits, approach_k: float) -> None:
        pressure, superheat = limits.lowest_reference.tolist()
        self.constants = (pressure, superheat, approach_k)
        self.curve = saturation_curve() if approach_k > NO_APPROACH_K else np.empty(0)
        raised = f"reference too low: raised to {pressure / 1e3:g} kPa, {superheat:g} K at least"
        words = {RAISED: raised, WARM: TOO_WARM, DRY: TOO_DRY}
        self.words = ["; ".join(text for one, text in words.items() if acts & one) for acts in range(BOUNDS)]
        self._bounds = ready(bounds)

    def bounded(
        self, pressure: float, superheat: float, air_inlet_temperature_c: float | None
    ) -> tuple[float, float, str]:
        """Return both references within their bounds, and which bounds act, in words, empty when none does.

        Parameters
        ----------
        pressure, superheat : float
            As they are wanted [Pa, K].
        air_inlet_temperature_c : float or None
            None: it is not known, and bounds nothing.
        """
        air_c = math.nan if air_inlet_temperature_c is None else air_inlet_temperature_c
        pressure, superheat, acts = self._bounds(self.curve, *self.constants, pressure, superheat, air_c)
        return pressure, superheat, self.words[acts]


@jit
def _pressure_at(curve: Array, temperature: float, above: float) -> float:
    """Return the saturation pressure [Pa] at `temperature` [K], by Newton's method in ln p from a pressure above."""
    logarithm = math.log(above)
    for _ in range(4):
        pressure = math.exp(logarithm)
        off = temperature_on(curve, pressure) - temperature
        logarithm -= off / (slope_on(curve, pressure) * pressure)
    return math.exp(logarithm)
