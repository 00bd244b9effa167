"""The cabin of a car as two lumps: its air, and the interior (seats, dashboard, trim, inner panels).

::

    m dW/dt    = m_b (W_vent - W) + n w_p
    dH/dt      = m_b (h_vent - h) + UA_i (T_i - T) + UA_o (T_o - T) + n (q_p + w_p h_p),    H = m h(T, W)
    C_i dT_i/dt = A_s I + UA_i (T - T_i)

Dry air of mass `m`, blower flow `m_b`, `n` people who give sensible heat `q_p` and water `w_p` (vapour at the skin's 34
degC), sun `I` through the aperture `A_s` onto the interior. As much air leaves as comes in: the recirculated part to
the evaporator, the rest through the vents at the back. What the evaporator breathes is cabin air and outside air mixed
by enthalpy and water.

The aperture and `UA_o` make an unventilated cabin settle at 20 K over the outside air in 1000 W/m2, with the interior
6 K hotter still: the soak of a car that the tests of cars begin with (SAE: about 60 degC of air in the sun at 40
degC; JAF: 52 to 57 degC in minivans at 35 degC). Structure of the model and shares of the loads: M. A.
Fayazbakhsh, M. Bahrami, Comprehensive modeling of vehicle air conditioning loads using heat balance method, SAE
2013-01-1507; D. Marcos et al., The development and validation of a thermal model for the cabin of a vehicle, Applied
Thermal Engineering 66 (2014) 646-656. People: ASHRAE Handbook, Fundamentals, chapter Nonresidential cooling and
heating load calculations (seated, very light work).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.dynamics.moist_air import (
    CP_VAPOUR_J_KGK,
    H_VAPOUR_J_KG,
    enthalpy,
    humidity_ratio,
    relative_humidity,
    temperature,
)

LONGEST_STEP_S = 0.5
"""Longest step of the fourth-order Runge-Kutta method; the air's time constant is some 8 s."""
CP_AIR_J_KGK = 1006.0
"""As the plant's parameter `air_cp_j_kgk` is by default."""
_VAPOUR_J_KG = H_VAPOUR_J_KG + 34.0 * CP_VAPOUR_J_KGK


@dataclass(frozen=True)
class CabinParameters:
    """A midsize car.

    Attributes
    ----------
    air_kg : float
        3 m3 of air.
    interior_j_k : float
        Seats, dashboard, trim and inner panels: 134 kJ/K is what NREL identified on a dynamometer for a Hyundai Sonata
        of 2021 (FASTSim, calibrated vehicles); 144 kJ/K has the JRC's model of a VW Golf 7 (Gil-Sayas), 74 kJ/K NREL's
        of a Chevrolet Bolt.
    interior_w_k : float
        Calibrated, with the vents blowing, on the JAF's pull-downs (docs/plant.md): 20 m2 of inner surface at 11.5
        W/(m2 K).
    outside_w_k : float
        NREL's Sonata: 6.07 m2 at 10.1 W/(m2 K) behind the 153 W/(m2 K) of the air at a standstill.
    aperture_m2 : float
        Calibrated on the soak, as above. The glass alone of the JRC's Golf lets in 0.6 m2; the body's heat is in it.
    person_sensible_w, person_latent_w : float
        Seated, very light work: 70 W and 45 W.
    """

    air_kg: float = 3.3
    interior_j_k: float = 134.0e3
    interior_w_k: float = 230.0
    outside_w_k: float = 58.0
    aperture_m2: float = 1.15
    person_sensible_w: float = 70.0
    person_latent_w: float = 45.0


@dataclass(frozen=True)
class CabinState:
    """Temperatures of air and interior, degC, and the humidity ratio of the air."""

    air_c: float
    interior_c: float
    humidity_ratio: float


@dataclass(frozen=True)
class Surroundings:
    """What is around and in the cabin.

    Attributes
    ----------
    outside_c, outside_humidity : float
        Outside air, degC and relative humidity 0..1.
    sun_w_m2 : float
    people : float
    recirculation : float
        Share of cabin air in what the evaporator breathes, 0..1.
    """

    outside_c: float
    outside_humidity: float = 0.4
    sun_w_m2: float = 0.0
    people: float = 1.0
    recirculation: float = 1.0


@dataclass(frozen=True)
class CabinStep:
    """Where a step has led, and the energy (J) and water (kg) that came into air and interior during it."""

    state: CabinState
    energy_in_j: float
    water_in_kg: float


def soaked(around: Surroundings, cabin: CabinParameters | None = None) -> CabinState:
    """Return the state of a closed car that has stood in the sun for long, with the outside air's water in it."""
    cabin = cabin or CabinParameters()
    sun = cabin.aperture_m2 * around.sun_w_m2
    air_c = around.outside_c + sun / cabin.outside_w_k
    return CabinState(
        air_c, air_c + sun / cabin.interior_w_k, humidity_ratio(around.outside_c, around.outside_humidity)
    )


def evaporator_inlet(state: CabinState, around: Surroundings) -> tuple[float, float]:
    """Return temperature (degC) and relative humidity (0..1) of the air that the evaporator breathes.

    Where the mixture carries mist (cold damp air into warm damp air), the relative humidity is 1 and the mist is lost.
    """
    outside = humidity_ratio(around.outside_c, around.outside_humidity)
    share = around.recirculation
    ratio = share * state.humidity_ratio + (1.0 - share) * outside
    h = share * enthalpy(state.air_c, state.humidity_ratio, CP_AIR_J_KGK)
    h += (1.0 - share) * enthalpy(around.outside_c, outside, CP_AIR_J_KGK)
    mixed_c = temperature(h, ratio, CP_AIR_J_KGK)
    return mixed_c, min(relative_humidity(mixed_c, ratio), 1.0)


def cabin_energy(state: CabinState, cabin: CabinParameters | None = None) -> tuple[float, float]:
    """Return the energy (J, from dry air and liquid water at 0 degC) and the water (kg) in a cabin."""
    cabin = cabin or CabinParameters()
    air = cabin.air_kg * enthalpy(state.air_c, state.humidity_ratio, CP_AIR_J_KGK)
    return air + cabin.interior_j_k * state.interior_c, cabin.air_kg * state.humidity_ratio


def cabin_step(
    state: CabinState,
    vent_c: float,
    vent_humidity_ratio: float,
    blower_kg_s: float,
    around: Surroundings,
    duration_s: float,
    cabin: CabinParameters | None = None,
) -> CabinStep:
    """Return the cabin after `duration_s` with vents, blower and surroundings held.

    Parameters
    ----------
    state : CabinState
    vent_c, vent_humidity_ratio, blower_kg_s : float
        Air out of the vents: degC, humidity ratio, dry air kg/s.
    around : Surroundings
    duration_s : float
    cabin : CabinParameters, optional

    Returns
    -------
    CabinStep
        Energy and water in it change by what came in, to round-off.
    """
    cabin = cabin or CabinParameters()
    vent_h = enthalpy(vent_c, vent_humidity_ratio, CP_AIR_J_KGK)
    breath = around.people * cabin.person_latent_w / _VAPOUR_J_KG
    sun, warmth = cabin.aperture_m2 * around.sun_w_m2, around.people * (cabin.person_sensible_w + cabin.person_latent_w)

    def rates(y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates of enthalpy and water of the air, energy of the interior, energy and water that came in."""
        h, ratio = y[0] / cabin.air_kg, y[1] / cabin.air_kg
        air_c, interior_c = temperature(h, ratio, CP_AIR_J_KGK), y[2] / cabin.interior_j_k
        inner = cabin.interior_w_k * (interior_c - air_c)
        outer = blower_kg_s * (vent_h - h) + cabin.outside_w_k * (around.outside_c - air_c) + warmth
        water = blower_kg_s * (vent_humidity_ratio - ratio) + breath
        return np.array([outer + inner, water, sun - inner, outer + sun, water])

    air_j = cabin.air_kg * enthalpy(state.air_c, state.humidity_ratio, CP_AIR_J_KGK)
    y = np.array([air_j, cabin.air_kg * state.humidity_ratio, cabin.interior_j_k * state.interior_c, 0.0, 0.0])
    steps = max(math.ceil(duration_s / LONGEST_STEP_S), 1)
    h = duration_s / steps
    for _ in range(steps):
        k_1 = rates(y)
        k_2 = rates(y + 0.5 * h * k_1)
        k_3 = rates(y + 0.5 * h * k_2)
        y = y + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + rates(y + h * k_3))
    ratio = float(y[1]) / cabin.air_kg
    after = CabinState(
        temperature(float(y[0]) / cabin.air_kg, ratio, CP_AIR_J_KGK), float(y[2]) / cabin.interior_j_k, ratio
    )
    return CabinStep(after, float(y[3]), float(y[4]))
