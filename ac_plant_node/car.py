"""The plant in a car: what the evaporator breathes is the cabin's air, what the condenser breathes is ram air and fan.

Plant and cabin are held against each other for one control interval: the cabin gives the evaporator its air as it was
when the interval began, and gets that from the vents which left the evaporator when it ended.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_common.signals import AirSide, Cabin, CarSide, Performance
from ac_plant_node.cabin import (
    CabinParameters,
    CabinState,
    Surroundings,
    cabin_step,
    evaporator_inlet,
    soaked,
)
from ac_plant_node.condenser_air import LOW, FrontEnd, condenser_air_flow, fan_stage
from ac_plant_node.dynamics.moist_air import humidity_ratio
from ac_plant_node.equilibrium import operating_point
from ac_plant_node.inputs import FAULT, INPUT
from ac_plant_node.plant import Outputs, Plant

N_CAR = 2 + len(AirSide._fields) + len(CarSide._fields)
"""Length of the inputs of a `Car`."""
_FAN = FAULT["condenser_fan"]


@dataclass(frozen=True)
class CarState:
    """Cabin, stage of the condenser's fan, and the time since the start."""

    cabin: CabinState
    stage: int = LOW
    time_s: float = 0.0


def car_inputs(
    state: CarState,
    command: NDArray[np.float64],
    blower_kg_s: float,
    around: Surroundings,
    vehicle_speed_m_s: float,
    fan_share: float = 1.0,
    front: FrontEnd | None = None,
    cabin: CabinParameters | None = None,
) -> NDArray[np.float64]:
    """Return the plant's inputs (7,) for a command (2,) of compressor speed rad/s and valve opening 0..1."""
    air_c, humidity = evaporator_inlet(state.cabin, around, cabin)
    flow = condenser_air_flow(vehicle_speed_m_s, state.stage, fan_share, front)
    return np.array([command[0], command[1], blower_kg_s, air_c, flow, around.outside_c, humidity])


def car_step(
    plant: Plant,
    state: CarState,
    inputs: NDArray[np.float64],
    around: Surroundings,
    duration_s: float,
    cabin: CabinParameters | None = None,
    front: FrontEnd | None = None,
) -> tuple[CarState, Outputs]:
    """Run the plant on with `inputs` from `car_inputs`, and return the car after that and the plant's outputs."""
    plant.step(inputs, duration_s)
    out = plant.outputs
    blower_kg_s, is_on = float(plant.inputs[2]), bool(inputs[0] > 0.0)
    after = _after(plant, state, blower_kg_s, out.condenser_pressure_pa, is_on, around, duration_s, cabin, front)
    return after, out


def _after(
    plant: Plant, state: CarState, blower_kg_s: float, head_pa: float, is_on: bool, around: Surroundings,
    duration_s: float, cabin: CabinParameters | None, front: FrontEnd | None,
) -> CarState:  # fmt: skip
    """Return the car after a step of its plant."""
    vent_c, vent_ratio = plant.vent_air
    after = cabin_step(state.cabin, vent_c, vent_ratio, blower_kg_s, around, duration_s, cabin).state
    return CarState(after, fan_stage(state.stage, head_pa, is_on, front), state.time_s + duration_s)


def cabin_at_start(around: Surroundings, cabin_c: float | None) -> CabinState:
    """Return the cabin with air and interior of `cabin_c`, degC, or soaked in the sun when that is None.

    It has the outside air's water in it, as far as air of its temperature holds that.
    """
    if cabin_c is None:
        return soaked(around)
    ratio = min(humidity_ratio(around.outside_c, around.outside_humidity), humidity_ratio(cabin_c, 1.0))
    return CabinState(cabin_c, cabin_c, ratio)


class Car:
    """Plant, cabin and front end together: a model with the inputs of a car in place of the air's at the evaporator.

    The air conditioner begins at its operating point, as if it had just got there when the cabin's air comes in.

    Parameters
    ----------
    point : str
        Operating point at which the air conditioner begins.
    cabin : CabinState
        The cabin then.

    Attributes
    ----------
    plant : Plant
    acted : ndarray, shape (7,)
        The plant's inputs of the step before, within its limits and without what its faults make of them.
    cabin : Cabin
        What the car reports of its cabin and front end.
    outputs : ndarray, shape (4,)
        As `step` returns them.
    """

    def __init__(self, point: str, cabin: CabinState) -> None:
        self.plant = Plant.at(point)
        self.outputs = np.array(operating_point(point).outputs)
        self._state, self._fan_share = CarState(cabin), 1.0
        self._parameters, self._front = CabinParameters(), FrontEnd()
        self.acted = self.plant.inputs
        self.cabin = self._report()

    def step(self, inputs: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        """Step with `inputs` held.

        Parameters
        ----------
        inputs : ndarray, shape (N_CAR,)
            Compressor speed [rad/s], valve opening [0..1]; the fields of `AirSide`, of which the air flow is the
            blower's, the condenser's inlet air the outside air and the humidity that of the outside air, while inlet
            temperature and air flow of the condenser are not used; the fields of `CarSide`. A belt speed above zero is
            the compressor's, whatever is commanded.
        duration_s : float

        Returns
        -------
        ndarray, shape (4,)
            As `Plant.step`, which also says what is raised.
        """
        command, air, side = inputs[:2], AirSide(*inputs[2:7].tolist()), CarSide(*inputs[7:].tolist())
        if side.belt_speed > 0.0:
            command = np.array([side.belt_speed, command[1]])
        around = Surroundings(air.condenser_inlet_temperature, air.humidity, side.sun, side.people, side.recirculation)
        cabin, front = self._parameters, self._front
        asked = car_inputs(
            self._state, command, air.mass_flow, around, side.vehicle_speed, self._fan_share, front, cabin
        )
        self.outputs = self.plant.step(asked, duration_s)
        self.acted = self.plant.inputs
        blower_kg_s, is_on = float(self.acted[2]), bool(asked[0] > 0.0)
        self._state = _after(
            self.plant, self._state, blower_kg_s, float(self.outputs[3]), is_on, around, duration_s, cabin, front
        )
        self.cabin = self._report()
        return self.outputs

    def hold_faults(self, sizes: Sequence[float]) -> None:
        """Have these faults from now on, as `Plant.hold_faults`; a dead fan leaves the ram air."""
        self._fan_share = 1.0 - min(max(sizes[_FAN], 0.0), 1.0)
        self.plant.hold_faults([0.0 if i == _FAN else size for i, size in enumerate(sizes)])

    @property
    def performance(self) -> Performance:
        """Return what the plant makes of it."""
        return self.plant.performance

    def _report(self) -> Cabin:
        state, acted = self._state.cabin, self.acted
        return Cabin(
            state.air_c,
            state.interior_c,
            float(acted[INPUT["air_humidity"]]),
            float(acted[INPUT["condenser_air_mass_flow"]]),
        )
