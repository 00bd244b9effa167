"""Air through the condenser of a car: ram air over the vehicle's speed, and a fan of two stages.

The flow meets a resistance that grows with its square. Ram pressure and fan stand in series, so their pressures add,
and with them the squares of the flows that each would make alone:

``m^2 = (rho A c v)^2 + m_fan^2``.

The fan runs at its low stage whenever the air conditioner is on. Its high stage comes in above one head pressure and
goes out below a lower one, as the middle pressure switch of a Honda does (service manual, Pilot 2014: above 1520 kPa,
below 930 kPa; others: Tata Nexon 2010 and 1520 kPa, Saab 9000 1650 and 1250 kPa). Above that range the compressor is
taken off load, at 3.1 MPa (`ac_plant_node.dynamics.balances`).
"""

import math
from dataclasses import dataclass

from ac_plant_node.inputs import INPUT, INPUT_HIGH, INPUT_LOW

OFF, LOW, HIGH = 0, 1, 2
"""Stages of the fan."""

_LEAST = float(INPUT_LOW[INPUT["condenser_air_mass_flow"]])
_MOST = float(INPUT_HIGH[INPUT["condenser_air_mass_flow"]])


@dataclass(frozen=True)
class FrontEnd:
    """The front end of a compact car.

    Attributes
    ----------
    face_area_m2 : float
        Of the condenser: 0.6 m by 0.4 m.
    ram_share : float
        Speed of the air in front of the condenser over the vehicle's, with grille, condenser and radiator in its way:
        0.15 to 0.3 in cars.
    air_density_kg_m3 : float
        At 30 degC.
    fan_kg_s : tuple of float
        Flow of the stages off, low, high at standstill; the high one is the plant's default.
    high_on_pa, high_off_pa : float
        Head pressures that switch the high stage.
    """

    face_area_m2: float = 0.24
    ram_share: float = 0.2
    air_density_kg_m3: float = 1.16
    fan_kg_s: tuple[float, float, float] = (0.0, 0.35, 0.55)
    high_on_pa: float = 1.52e6
    high_off_pa: float = 0.93e6


def fan_stage(stage: int, head_pressure_pa: float, compressor_on: bool, front: FrontEnd | None = None) -> int:
    """Return the stage of the fan, `OFF`, `LOW` or `HIGH`, that follows `stage` at this head pressure."""
    front = front or FrontEnd()
    if stage == HIGH and head_pressure_pa >= front.high_off_pa:
        return HIGH
    if head_pressure_pa > front.high_on_pa:
        return HIGH
    return LOW if compressor_on else OFF


def condenser_air_flow(
    vehicle_speed_m_s: float, stage: int, fan_share: float = 1.0, front: FrontEnd | None = None
) -> float:
    """Return the air through the condenser, kg/s, within the range of the plant's input.

    Parameters
    ----------
    vehicle_speed_m_s : float
    stage : int
        Of the fan.
    fan_share : float
        What is left of the fan's flow, 0 for a dead fan. This is where a dead fan belongs when there is ram air; the
        plant's own fault `condenser_fan` takes its share of all the air.
    front : FrontEnd, optional
    """
    front = front or FrontEnd()
    ram = front.air_density_kg_m3 * front.face_area_m2 * front.ram_share * abs(vehicle_speed_m_s)
    return min(max(math.hypot(ram, fan_share * front.fan_kg_s[stage]), _LEAST), _MOST)
