"""References that the plant can follow: at least what protects it, at most what the inlet air allows.

The refrigerant cannot leave the evaporator warmer than the air that enters it, and near it the valve is all but shut:
`SH <= T_air - T_sat(p_e) - approach`. Where that leaves less than the lowest superheat, p_e has to be lower.
"""

import math

from ac_plant_node.saturation import saturation_curve, slope_on, temperature_on
from gimc_controller_node.compiled import Array, jit
from gimc_controller_node.controller import NO_APPROACH_K
from gimc_controller_node.protection import ProtectionLimits

TOO_DRY = "superheat reference beyond what the inlet air allows: capped"
TOO_WARM = "pressure reference beyond what the inlet air allows: capped"
_ZERO_C = 273.15


class ReferenceLimits:
    """Bounds of the references of p_e [Pa] and SH [K], and what is said when one acts.

    Parameters
    ----------
    limits : ProtectionLimits
    approach_k : float
        As in `ControllerDesign`.
    """

    def __init__(self, limits: ProtectionLimits, approach_k: float) -> None:
        pressure, superheat = limits.lowest_reference.tolist()
        self._lowest = (pressure, superheat)
        self._approach_k = approach_k
        self._curve = saturation_curve() if approach_k > NO_APPROACH_K else None
        self._raised = f"reference too low: raised to {pressure / 1e3:g} kPa, {superheat:g} K at least"

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
        lowest_pressure, driest = self._lowest
        texts: tuple[str, ...] = ()
        if pressure < lowest_pressure or superheat < driest:
            pressure, superheat = max(pressure, lowest_pressure), max(superheat, driest)
            texts = (self._raised,)
        if air_inlet_temperature_c is not None and self._curve is not None:
            outlet = air_inlet_temperature_c + _ZERO_C - self._approach_k
            highest = outlet - temperature_on(self._curve, pressure)
            if highest < driest and pressure > lowest_pressure:
                pressure = max(_pressure_at(self._curve, outlet - driest, pressure), lowest_pressure)
                highest = driest
                texts += (TOO_WARM,)
            if superheat > max(highest, driest):
                superheat = max(highest, driest)
                texts += (TOO_DRY,)
        return pressure, superheat, "; ".join(texts) if texts else ""


@jit
def _pressure_at(curve: Array, temperature: float, above: float) -> float:
    """Return the saturation pressure [Pa] at `temperature` [K], by Newton's method in ln p from a pressure above."""
    logarithm = math.log(above)
    for _ in range(4):
        pressure = math.exp(logarithm)
        off = temperature_on(curve, pressure) - temperature
        logarithm -= off / (slope_on(curve, pressure) * pressure)
    return math.exp(logarithm)
