"""The plant as an object: starts at an operating point, steps with inputs held, has outputs and balances."""

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_common.units import RPM
from ac_plant_node.dynamics import balances as model
from ac_plant_node.dynamics import integrator
from ac_plant_node.equilibrium import OperatingPoint, operating_point
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters
from ac_plant_node.properties.tables import load_tables

_FOUR_NUMBERS = "plant inputs must be four finite numbers: speed rad/s, opening 0..1, air kg/s, air degC"
_LEFT = "the plant left its model's domain: pressure outside the property tables"


@dataclass(frozen=True)
class Outputs:
    """Outputs of the plant, SI but for the wall temperature in degC."""

    evaporator_pressure_pa: float
    superheat_k: float
    wall_temperature_c: float
    condenser_pressure_pa: float
    cooling_power_w: float


class Plant:
    """The nonlinear moving-boundary air conditioner.

    Inputs outside `INPUT_LOW` .. `INPUT_HIGH` of `ac_plant_node.dynamics.balances` saturate there, as the actuators and
    the blower of a car do (a fault may push a command past its stop); inputs that are not finite are refused. Within
    that box no input breaks the plant.

    Parameters
    ----------
    state : (12,) array
        Integration state, see `ac_plant_node.dynamics.balances`.
    inputs : (4,) array
        Compressor speed rad/s, valve opening 0..1, evaporator air flow kg/s, evaporator air inlet degC.
    parameters : Parameters, optional
        The shipped set by default.
    tolerance : float
        Local error of an integration step, relative to the sizes in `ac_plant_node.dynamics.integrator.ERROR_SCALE`.
    """

    def __init__(
        self,
        state: NDArray[np.float64],
        inputs: NDArray[np.float64],
        parameters: Parameters | None = None,
        tolerance: float = integrator.DEFAULT_TOLERANCE,
    ) -> None:
        self._parameters = parameters or load_parameters()
        self._par = self._parameters.array
        self._tab = load_tables(self._parameters.refrigerant)
        self._array = integrator.new_work(state, tolerance)
        self._work = integrator.views(self._array)
        self._aux = self._work.aux
        self._has_left = False
        self.step(inputs, 0.0)

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
        other._array = self._array.copy()
        other._work = integrator.views(other._array)
        other._aux = other._work.aux
        return other

    def step(self, inputs: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        """Step with `inputs` held.

        Parameters
        ----------
        inputs : (4,) array
            Compressor speed rad/s, valve opening 0..1, evaporator air flow kg/s, evaporator air inlet degC; clipped
            to the permitted box.
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
        w = np.array(inputs, dtype=float)  # a copy, for the compiled code knows contiguous arrays only
        if w.shape != (4,):
            raise ValueError(_FOUR_NUMBERS)
        if not 0.0 <= duration_s < 1.0e7:
            raise ValueError(f"duration must be between 0 and 1e7 s, not {duration_s:g}")
        outputs = np.empty(4)
        status = integrator.run(self._array, self._par, self._tab, w, float(duration_s), outputs)
        if status == integrator.NOT_FINITE:
            raise ValueError(_FOUR_NUMBERS)
        if status == integrator.OUTSIDE:
            self._has_left = True
            raise ValueError(_LEFT)
        return outputs

    def advance(
        self,
        duration_s: float,
        compressor_speed_rpm: float | None = None,
        valve_opening_percent: float | None = None,
        air_mass_flow_kg_s: float | None = None,
        air_inlet_temperature_c: float | None = None,
    ) -> Outputs:
        """Step with inputs held; those left out keep their values. Raises as `step`."""
        w = self._work.held.copy()
        if compressor_speed_rpm is not None:
            w[0] = compressor_speed_rpm * RPM
        if valve_opening_percent is not None:
            w[1] = valve_opening_percent / 100.0
        if air_mass_flow_kg_s is not None:
            w[2] = air_mass_flow_kg_s
        if air_inlet_temperature_c is not None:
            w[3] = air_inlet_temperature_c
        self.step(w, duration_s)
        return self.outputs

    @property
    def outputs(self) -> Outputs:
        """Return the present outputs."""
        a = self._aux
        return Outputs(
            float(a[model.P_E]), float(a[model.SUPERHEAT]), float(a[model.WALL_E2]) - 273.15, float(a[model.P_C]),
            float(a[model.Q_AIR_E]),
        )  # fmt: skip

    @property
    def inputs(self) -> NDArray[np.float64]:
        """Return the inputs held at present (4,), as clipped to the permitted box."""
        return self._work.held.copy()

    @property
    def state(self) -> NDArray[np.float64]:
        """Return the paper's state x (12,), see `OperatingPoint.state`."""
        return self._aux[:12].copy()

    @property
    def steps_tried(self) -> float:
        """Return the number of integration steps since the plant was made, refused ones included: a measure of work."""
        return float(self._work.memory[integrator.N_STEPS] + self._work.memory[integrator.N_REJECTED])

    @property
    def refrigerant_mass_kg(self) -> float:
        """Return the refrigerant in both heat exchangers, summed over the zones from their densities."""
        return float(self._aux[model.MASS])

    @property
    def stored_energy_j(self) -> float:
        """Return the internal energy of the refrigerant, summed over the zones, and of the walls."""
        p, y = self._parameters, self._work.y
        return float(self._aux[model.ENERGY] + p["evaporator_wall_j_k"] * y[3] + p["condenser_wall_j_k"] * y[9])

    @property
    def heat_in_w(self) -> float:
        """Return the net power into refrigerant and walls: from both air streams, and the compressor's work."""
        return float(self._aux[model.HEAT_IN])

    @property
    def heat_in_j(self) -> float:
        """Return the integral of `heat_in_w` since the plant was made, by the integrator's own quadrature."""
        return float(self._work.y[5])

    @property
    def heat_moved_j(self) -> float:
        """Return the integral of the magnitudes of the three powers in `heat_in_w`, over whole steps: a scale."""
        return float(self._work.memory[integrator.MOVED])
