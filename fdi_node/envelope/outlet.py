"""The superheat of a thermocouple at the evaporator's outlet, as the observer reads it."""

from ac_common.compiled import Array, step_compiler
from ac_plant_node.saturation import slope_on, temperature_on
from fdi_node.envelope.memory import SLOPE

LEAST_PRESSURE_PA = 1.0e4
_jit = step_compiler("ac_plant_node.saturation", "fdi_node.envelope.memory", "fdi_node.envelope.outlet")


@_jit
def take_outlet_temperature(out: Array, scalars: Array, curve: Array, reading: Array, pressure_pa: float) -> None:
    """Read the superheat that the outlet temperature means at the pressure that is predicted, not at the one it is of.

    Whatever the pressure's sensor is off by is then in one reading only.

    Parameters
    ----------
    out, scalars : array
        Parts of the observer's memory.
    curve : array
        From `ac_plant_node.saturation.saturation_curve`.
    reading : (4,) array
        As of `fdi_node.envelope.filter.observe`; the superheat is changed.
    pressure_pa : float
        With which the superheat has been derived.
    """
    predicted = max(out[0], LEAST_PRESSURE_PA)
    reading[1] += temperature_on(curve, max(pressure_pa, LEAST_PRESSURE_PA)) - temperature_on(curve, predicted)
    scalars[SLOPE] = slope_on(curve, predicted)
