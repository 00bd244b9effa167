"""The plant in a car: what the evaporator breathes is the cabin's air, what the condenser breathes is ram air and fan.

Plant and cabin are held against each other for one control interval: the cabin gives the evaporator its air as it was
when the interval began, and gets that from the vents which left the evaporator when it ended.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.cabin import CabinParameters, CabinState, Surroundings, cabin_step, evaporator_inlet
from ac_plant_node.condenser_air import LOW, FrontEnd, condenser_air_flow, fan_stage
from ac_plant_node.plant import Outputs, Plant


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
) -> NDArray[np.float64]:
    """Return the plant's inputs (7,) for a command (2,) of compressor speed rad/s and valve opening 0..1."""
    air_c, humidity = evaporator_inlet(state.cabin, around)
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
    after = cabin_step(
        state.cabin, out.air_outlet_temperature_c, out.air_outlet_humidity_ratio, float(plant.inputs[2]), around,
        duration_s, cabin,
    ).state  # fmt: skip
    stage = fan_stage(state.stage, out.condenser_pressure_pa, bool(inputs[0] > 0.0), front)
    return replace(state, cabin=after, stage=stage, time_s=state.time_s + duration_s), out
