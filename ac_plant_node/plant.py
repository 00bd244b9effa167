"""The plant as an object: starts at an operating point, steps with inputs held, has outputs and balances."""

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_common.signals import Performance
from ac_plant_node.dynamics import balances, integrator, workspace
from ac_plant_node.dynamics.drive import OPENING, VALVE, default_held, outlet_air
from ac_plant_node.dynamics.moist_air import relative_humidity
from ac_plant_node.dynamics.telling import N_OUTPUTS, N_TOLD, run_and_tell
from ac_plant_node.equilibrium import OperatingPoint, operating_point
from ac_plant_node.inputs import (
    FAULT_HIGH,
    FAULT_LOW,
    INPUT_HIGH,
    INPUT_LOW,
    INPUTS,
    N_INPUTS,
    N_PAPER,
    N_PHYSICS,
    TO_SI,
    fault_vector,
)
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters
from ac_plant_node.properties.tables import load_tables
from ac_plant_node.valve_actuator import LONGEST_STEP_S, valve_motion

_FINITE = f"plant inputs must be {N_PAPER} to {N_INPUTS} finite numbers: {'; '.join(row.meaning for row in INPUTS)}"
_LEFT = "the plant left its model's domain: pressure outside the property tables"


@dataclass(frozen=True)
class Outputs:
    """Outputs of the plant, SI but for temperatures in degC and the humidity in per cent.

    `cooling_power_w` is all the heat that the air gives to the evaporator, `latent_cooling_w` the part that water
    brings which condenses (`condensed_water_kg_s`); `frost_kg_s` is the part of that water which falls on walls below 0
    degC. `air_outlet_...`: the air behind the evaporator, which the vents blow.
    """

    evaporator_pressure_pa: float
    superheat_k: float
    wall_temperature_c: float
    condenser_pressure_pa: float
    cooling_power_w: float
    subcooling_k: float
    compressor_power_w: float
    latent_cooling_w: float
    condensed_water_kg_s: float
    frost_kg_s: float
    air_outlet_temperature_c: float
    air_outlet_humidity_ratio: float

    @property
    def sensible_cooling_w(self) -> float:
        """Heat that the air gives without its water."""
        return self.cooling_power_w - self.latent_cooling_w

    @property
    def frost(self) -> bool:
        """Whether ice grows on the evaporator."""
        return self.frost_kg_s > 0.0

    @property
    def air_outlet_humidity_percent(self) -> float:
        """Relative humidity of the air behind the evaporator, 100 where it carries mist."""
        return 100.0 * min(relative_humidity(self.air_outlet_temperature_c, self.air_outlet_humidity_ratio), 1.0)

    @property
    def cop(self) -> float:
        """Cooling over compressor power; nan while the compressor does no work."""
        return self.cooling_power_w / self.compressor_power_w if self.compressor_power_w > 0.0 else float("nan")


class Plant:
    """The nonlinear moving-boundary air conditioner.

    Inputs outside `INPUT_LOW` .. `INPUT_HIGH` of `ac_plant_node.inputs` saturate there, as the actuators and the blower
    of a car do (a fault may push a command past its stop); inputs that are not finite are refused. Within that box no
    input and no fault breaks the plant.

    Parameters
    ----------
    state : (12,) array
        Integration state, see `ac_plant_node.dynamics.balances`.
    inputs : (n,) array, n from 4 to N_INPUTS
        In the order of `ac_plant_node.inputs.INPUTS`; those left out are the parameters' (dry air at the evaporator).
    parameters : Parameters, optional
        The shipped set by default.
    tolerance : float
        Local error of an integration step, relative to the sizes in `ac_plant_node.dynamics.workspace.ERROR_SCALE`.
    """

    def __init__(
        self,
        state: NDArray[np.float64],
        inputs: NDArray[np.float64],
        parameters: Parameters | None = None,
        tolerance: float = integrator.DEFAULT_TOLERANCE,
    ) -> None:
        self._parameters = parameters or load_parameters()
        self._par = self._parameters.values
        self._tab = load_tables(self._parameters.refrigerant)
        self._array = integrator.new_work(state, tolerance)
        self._work = workspace.views(self._array)
        self._aux = self._work.aux
        self._results = np.zeros(N_TOLD)
        self._has_left = False
        self._told = default_held(self._parameters)
        self._actuator: NDArray[np.float64] | None = None  # while the valve's actuator is healthy
        self._position = 0.0  # of the valve, while it is not
        self.step(inputs, 0.0)
        self._mass_at_first_kg = float(self._work.memory[workspace.CHARGE])

    @classmethod
    def at(cls, point: str | OperatingPoint, tolerance: float = integrator.DEFAULT_TOLERANCE) -> "Plant":
        """Return a plant at rest at an operating point ("low", "med", "high", or any `OperatingPoint`).

        Raises
        ------
        ValueError
            For an unknown name.
        """
        at = operating_point(point) if isinstance(point, str) else point
        return cls(at.conserved, at.inputs, tolerance=tolerance)

    def copy(self) -> "Plant":
        """Return a second plant in the same state, independent of this one."""
        other = copy(self)
        other._array, other._told, other._results = self._array.copy(), self._told.copy(), self._results.copy()
        other._work = workspace.views(other._array)
        other._aux = other._work.aux
        return other

    def step(self, inputs: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        """Step with `inputs` held.

        Parameters
        ----------
        inputs : (n,) array, n from 4 to N_INPUTS
            In the order of `ac_plant_node.inputs.INPUTS`, SI, degC; clipped to the permitted box. Those left out keep
            their values.
        duration_s : float
            Any length; resolved to a nanosecond.

        Returns
        -------
        (4,) array
            p_e Pa, SH K, T_w degC, p_c Pa.

        Raises
        ------
        ValueError
            For inputs that are not finite, a negative duration, or a state that left the model's domain; after that
            for every further step.
        """
        if self._has_left:
            raise ValueError(_LEFT)
        if not 0.0 <= duration_s < 1.0e7:
            raise ValueError(f"duration must be between 0 and 1e7 s, not {duration_s:g}")
        given = len(inputs)
        if not N_PAPER <= given <= N_INPUTS:
            raise ValueError(_FINITE)
        told = self._told if self._actuator is None else self._told.copy()
        try:
            told[:given] = inputs
        except ValueError as problem:
            raise ValueError(_FINITE) from problem
        if self._actuator is not None:
            return self._step_of_faulty_valve(told, float(duration_s), self._actuator)
        return self._run(told, float(duration_s))

    def _run(self, held: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        status = run_and_tell(self._array, self._par, *self._tab, held, duration_s, self._results)
        if status == 0:
            return self._results[:N_OUTPUTS].copy()
        if status == integrator.NOT_FINITE:
            self._told[:N_INPUTS] = self._work.held[:N_INPUTS]  # as if they had never been told
            raise ValueError(_FINITE)
        self._has_left = True
        raise ValueError(_LEFT)

    def _step_of_faulty_valve(
        self, told: NDArray[np.float64], duration_s: float, actuator: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Step with a valve that is stuck or slow: the opening held is where it is, not where it is told to be."""
        if not np.isfinite(told).all():
            raise ValueError(_FINITE)
        self._told[:] = told
        held, (stuck, time_constant_s) = told.copy(), actuator
        holds, command = max(math.ceil(duration_s / LONGEST_STEP_S - 1e-9), 1), min(max(float(told[OPENING]), 0.0), 1.0)
        if stuck:
            holds, command, time_constant_s = 1, self._position, 0.0
        for _ in range(holds):
            held[OPENING], self._position = valve_motion(self._position, command, time_constant_s, duration_s / holds)
            outputs = self._run(held, duration_s / holds)
        return outputs

    def set_faults(self, sizes: Mapping[str, float]) -> None:
        """Give the plant's components these faults from now on, and no others.

        Parameters
        ----------
        sizes : mapping
            Size of each fault by kind, in the unit of `ac_plant_node.inputs.FAULTS`; ``{}``: a healthy plant.

        Raises
        ------
        UserError
            One line: a kind that is not known, or a size outside its range.
        """
        self.hold_faults(fault_vector(sizes))

    def hold_faults(self, sizes: Sequence[float] | NDArray[np.float64]) -> None:
        """Do as `set_faults`, with SI sizes (N_FAULTS,) in the order of `FAULTS`; those out of range are clipped."""
        faults = np.clip(sizes, FAULT_LOW, FAULT_HIGH)
        if self._actuator is None:
            self._position = float(self._work.held[OPENING])
        self._told[N_INPUTS:] = faults[:N_PHYSICS]
        self._actuator = faults[N_PHYSICS:] if faults[N_PHYSICS:].any() else None

    def advance(
        self,
        duration_s: float,
        compressor_speed_rpm: float | None = None,
        valve_opening_percent: float | None = None,
        air_mass_flow_kg_s: float | None = None,
        air_inlet_temperature_c: float | None = None,
        condenser_air_mass_flow_kg_s: float | None = None,
        condenser_air_inlet_temperature_c: float | None = None,
        air_humidity_percent: float | None = None,
    ) -> Outputs:
        """Step with inputs held; those left out keep their values. Raises as `step`."""
        given = (
            compressor_speed_rpm, valve_opening_percent, air_mass_flow_kg_s, air_inlet_temperature_c,
            condenser_air_mass_flow_kg_s, condenser_air_inlet_temperature_c, air_humidity_percent,
        )  # fmt: skip
        w = self._told[:N_INPUTS].copy()
        for i, (row, value) in enumerate(zip(INPUTS, given, strict=True)):
            if value is not None:
                w[i] = TO_SI[row.unit](value)
        self.step(w, duration_s)
        return self.outputs

    @property
    def outputs(self) -> Outputs:
        """Return the present outputs."""
        a, (air_c, ratio) = self._aux, self.vent_air
        return Outputs(
            float(a[balances.P_E]), float(a[balances.SUPERHEAT]), float(a[balances.WALL_E2]) - 273.15,
            float(a[balances.P_C]), float(a[balances.Q_AIR_E]), float(a[balances.SUBCOOLING]), float(a[balances.POWER]),
            float(a[balances.LATENT]), float(a[balances.WATER]), float(a[balances.FROST]), air_c, ratio,
        )  # fmt: skip

    @property
    def vent_air(self) -> tuple[float, float]:
        """Return temperature (degC) and humidity ratio of the air behind the evaporator."""
        a = self._aux
        return outlet_air(self._work.drive, self._par, a[balances.Q_AIR_E], a[balances.WATER], a[balances.DRAINED])

    @property
    def performance(self) -> Performance:
        """Return the part of `outputs` that a run records at every tick, SI; faster than all of them."""
        return Performance(*self._results[N_OUTPUTS:].tolist())

    @property
    def inputs(self) -> NDArray[np.float64]:
        """Return the inputs held at present (N_INPUTS,), clipped to the box; of a faulty valve its command."""
        return np.clip(self._told[:N_INPUTS], INPUT_LOW, INPUT_HIGH)

    @property
    def valve_position(self) -> float:
        """Return the opening (0..1) that the valve really has, faults included."""
        return float(self._work.drive[VALVE])

    @property
    def state(self) -> NDArray[np.float64]:
        """Return the paper's state x (12,), see `OperatingPoint.state`."""
        return self._aux[:12].copy()

    @property
    def steps_tried(self) -> float:
        """Return the number of integration steps since the plant was made, refused ones included: a measure of work."""
        return float(self._work.memory[workspace.N_STEPS] + self._work.memory[workspace.N_REJECTED])

    @property
    def refrigerant_mass_kg(self) -> float:
        """Return the refrigerant in both heat exchangers, summed over the zones from their densities."""
        return float(self._aux[balances.MASS])

    @property
    def stored_energy_j(self) -> float:
        """Return the internal energy of the refrigerant, summed over the zones, and of the walls."""
        p, y = self._parameters, self._work.y
        return float(self._aux[balances.ENERGY] + p["evaporator_wall_j_k"] * y[3] + p["condenser_wall_j_k"] * y[9])

    @property
    def heat_in_w(self) -> float:
        """Return the net power into refrigerant and walls: from both air streams, and the compressor's work."""
        return float(self._aux[balances.HEAT_IN])

    @property
    def heat_in_j(self) -> float:
        """Return the integral of `heat_in_w` since the plant was made, by the integrator's own quadrature."""
        return float(self._work.y[5]) + self.leaked_energy_j

    @property
    def leaked_mass_kg(self) -> float:
        """Return the refrigerant that has leaked since the plant was made."""
        memory = self._work.memory
        charge = memory[workspace.CHARGE] - memory[workspace.LEAK_RATE] * memory[workspace.T_HELD]
        return self._mass_at_first_kg - float(charge)

    @property
    def leaked_energy_j(self) -> float:
        """Return the enthalpy that has left with it: what is stored changes by `heat_in_j` less this."""
        return float(self._work.memory[workspace.LEAKED_NOW_J])

    @property
    def heat_moved_j(self) -> float:
        """Return the integral of the magnitudes of the three powers in `heat_in_w`, over whole steps: a scale."""
        return float(self._work.memory[workspace.MOVED])


def handed_over(plant: Plant) -> tuple[NDArray[np.float64], ...]:
    """Return what a plant with a healthy valve hands to `run_and_tell`, but for the duration: arrays in use."""
    return plant._array, plant._par, *plant._tab, plant._told, plant._results
