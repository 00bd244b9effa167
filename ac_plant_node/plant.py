"""The plant as an object: rests at a point, runs on with inputs held, tells its outputs and its balances."""

import math
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_plant_node import integrator, model
from ac_plant_node.equilibrium import OperatingPoint, operating_point
from ac_plant_node.parameters import Parameters, load_parameters
from ac_plant_node.tables import load_tables

RPM = 2.0 * np.pi / 60.0
"""rad/s in one rpm."""


INPUT_LOW = np.array([0.0, 0.0, 0.02, 10.0])
"""Lowest inputs: rad/s, opening 0..1, kg/s, degC."""
INPUT_HIGH = np.array([6000.0 * RPM, 1.0, 0.3, 50.0])
"""Highest inputs: 6000 rpm, valve fully open, 0.3 kg/s, 50 degC."""
_LOW: list[float] = INPUT_LOW.tolist()
_HIGH: list[float] = INPUT_HIGH.tolist()


@dataclass(frozen=True)
class Outputs:
    """What can be read from the plant, SI but for the wall temperature in degC."""

    evaporator_pressure_pa: float
    superheat_k: float
    wall_temperature_c: float
    condenser_pressure_pa: float
    cooling_power_w: float


class Plant:
    """The nonlinear moving-boundary air conditioner.

    Inputs outside `INPUT_LOW` .. `INPUT_HIGH` saturate there, as the actuators and the blower of a car do (a fault may
    push a command past its stop); inputs that are not finite are refused. Within that box no input breaks the plant.

    Parameters
    ----------
    state : (12,) array
        Integration state, see `ac_plant_node.model`.
    inputs : (4,) array
        Compressor speed rad/s, valve opening 0..1, evaporator air flow kg/s, evaporator air inlet degC.
    parameters : Parameters, optional
        The shipped set by default.
    tolerance : float
        Local error of an integration step, relative to the sizes in `ac_plant_node.integrator.ERROR_SCALE`.
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
        self._y = np.array(state, dtype=float)
        self._charge = float(self._y[0] + self._y[5])
        self._y[5] = 0.0
        self._w = np.array(inputs, dtype=float)
        self._held: list[float] = self._w.tolist()
        self._guess, self._z, _, self._aux = model.new_workspace()
        self._work = integrator.new_work(tolerance)
        self._memory = self._work.memory
        self._clock_ns = 0
        self._out = np.zeros(4)
        self._run()

    @classmethod
    def at(cls, point: str | OperatingPoint, tolerance: float = integrator.DEFAULT_TOLERANCE) -> "Plant":
        """A plant resting at an operating point ("low", "med", "high", or any `OperatingPoint`).

        Raises
        ------
        ValueError
            For an unknown name.
        """
        at = operating_point(point) if isinstance(point, str) else point
        return cls(at.conserved, at.inputs, tolerance=tolerance)

    def copy(self) -> "Plant":
        """A second plant in the very same state, which runs on by itself."""
        other = copy(self)
        for name in ("_y", "_w", "_guess", "_z", "_aux", "_out"):
            setattr(other, name, getattr(self, name).copy())
        other._work = integrator.Work._make(array.copy() for array in self._work)
        other._memory = other._work.memory
        return other

    def step(self, inputs: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        """Run on with `inputs` held.

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
            For inputs that are not finite, a negative duration, or a state that left the model's domain.
        """
        w = np.asarray(inputs, dtype=float)
        if w.shape != (4,) or not math.isfinite(w.sum()):  # a sum with inf or nan in it is not finite either
            raise ValueError("plant inputs must be four finite numbers: speed rad/s, opening 0..1, air kg/s, air degC")
        if not 0.0 <= duration_s < 1.0e7:
            raise ValueError(f"duration must be between 0 and 1e7 s, not {duration_s:g}")
        held = [min(max(x, low), high) for x, low, high in zip(w.tolist(), _LOW, _HIGH, strict=True)]
        if held != self._held:
            self._held = held
            self._w[:] = held
            self._memory[integrator.FRESH] = 1.0
            self._clock_ns = 0
        self._clock_ns += round(duration_s * 1.0e9)
        self._run()
        self._out[0] = self._aux[1]
        self._out[1] = self._aux[model.SUPERHEAT]
        self._out[2] = self._aux[model.WALL_E2] - 273.15
        self._out[3] = self._aux[7]
        return self._out.copy()

    def _run(self) -> None:
        status = integrator.run(
            self._y, *self._work, self._charge, self._w, self._par, self._tab, self._guess, self._z, self._aux,
            self._clock_ns * 1.0e-9,
        )  # fmt: skip
        if status != 0:
            raise ValueError("the plant left its model's domain: pressure outside the property tables")

    def advance(
        self,
        duration_s: float,
        compressor_speed_rpm: float | None = None,
        valve_opening_percent: float | None = None,
        air_mass_flow_kg_s: float | None = None,
        air_inlet_temperature_c: float | None = None,
    ) -> Outputs:
        """Run on with inputs held; those left out keep their values. Raises as `step`."""
        w = self._w.copy()
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
        """The outputs now."""
        a = self._aux
        return Outputs(
            float(a[1]), float(a[model.SUPERHEAT]), float(a[model.WALL_E2]) - 273.15, float(a[7]),
            float(a[model.Q_AIR_E]),
        )  # fmt: skip

    @property
    def inputs(self) -> NDArray[np.float64]:
        """The inputs held now (4,), as clipped to the permitted box."""
        return self._w.copy()

    @property
    def state(self) -> NDArray[np.float64]:
        """The paper's state x (12,), see `OperatingPoint.state`."""
        return self._aux[:12].copy()

    @property
    def steps_tried(self) -> float:
        """Integration steps since the plant was made, refused ones included: the measure of the work done."""
        return float(self._memory[integrator.N_STEPS] + self._memory[integrator.N_REJECTED])

    @property
    def refrigerant_mass_kg(self) -> float:
        """Refrigerant in both heat exchangers, summed over the zones from their densities."""
        return float(self._aux[model.MASS])

    @property
    def stored_energy_j(self) -> float:
        """Internal energy of the refrigerant, summed over the zones, and of the walls."""
        p = self._parameters
        return float(
            self._aux[model.ENERGY] + p["evaporator_wall_j_k"] * self._y[3] + p["condenser_wall_j_k"] * self._y[9]
        )

    @property
    def heat_in_w(self) -> float:
        """Net power into refrigerant and walls now: from both air streams, and the compressor's work."""
        return float(self._aux[model.HEAT_IN])

    @property
    def heat_in_j(self) -> float:
        """Integral of `heat_in_w` since the plant was made, by the integrator's own quadrature."""
        return float(self._y[5])

    @property
    def heat_moved_j(self) -> float:
        """Integral of the magnitudes of the three powers in `heat_in_w`."""
        return float(self._memory[integrator.MOVED])
