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

from dataclasses import astuple, dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.dynamics import cabin_air
from ac_plant_node.dynamics.moist_air import enthalpy, humidity_ratio
from ac_plant_node.parameters.file import load_parameters


def _air_cp_j_kgk() -> float:
    return load_parameters()["air_cp_j_kgk"]


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
    air_cp_j_kgk : float
        Dry air: the plant's parameter of that name.
    """

    air_kg: float = 3.3
    interior_j_k: float = 134.0e3
    interior_w_k: float = 230.0
    outside_w_k: float = 58.0
    aperture_m2: float = 1.15
    person_sensible_w: float = 70.0
    person_latent_w: float = 45.0
    air_cp_j_kgk: float = field(default_factory=_air_cp_j_kgk)

    @cached_property
    def array(self) -> NDArray[np.float64]:
        """All of them in this order, for the compiled code."""
        return np.array(astuple(self))


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


def evaporator_inlet(
    state: CabinState, around: Surroundings, cabin: CabinParameters | None = None
) -> tuple[float, float]:
    """Return temperature (degC) and relative humidity (0..1) of the air that the evaporator breathes.

    Where the mixture carries mist (cold damp air into warm damp air), the relative humidity is 1 and the mist is lost.
    """
    cp_air = (cabin or CabinParameters()).air_cp_j_kgk
    return cabin_air.mixed(
        state.air_c, state.humidity_ratio, around.outside_c, around.outside_humidity, around.recirculation, cp_air
    )


def cabin_energy(state: CabinState, cabin: CabinParameters | None = None) -> tuple[float, float]:
    """Return the energy (J, from dry air and liquid water at 0 degC) and the water (kg) in a cabin."""
    cabin = cabin or CabinParameters()
    air = cabin.air_kg * enthalpy(state.air_c, state.humidity_ratio, cabin.air_cp_j_kgk)
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
    air_c, interior_c, ratio, energy_in_j, water_in_kg = cabin_air.step(
        state.air_c, state.interior_c, state.humidity_ratio, vent_c, vent_humidity_ratio, blower_kg_s,
        around.outside_c, around.sun_w_m2, around.people, duration_s, cabin.array,
    )  # fmt: skip
    return CabinStep(CabinState(air_c, interior_c, ratio), energy_in_j, water_in_kg)
