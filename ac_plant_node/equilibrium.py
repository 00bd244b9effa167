"""Equilibria of the plant: all rates zero with the given refrigerant charge."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.units import RPM
from ac_plant_node.calibration import row_inputs, starting_state, superheated_enthalpy
from ac_plant_node.dynamics import balances, integrator, workspace
from ac_plant_node.dynamics.drive import drive, held_inputs
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters
from ac_plant_node.properties.tables import Tables, load_tables

X_SCALE = np.array([0.1, 1.0e4, 1.0e4, 5.0, 5.0, 0.1, 0.1, 1.0e5, 1.0e4, 5.0, 5.0, 5.0])
"""Sizes of the public state's components, for differences and solvers."""
RATE_SCALE = np.array([1.0e-3, 1.0e3, 1.0e4, 1.0, 1.0, 1.0e-3, 1.0e3, 0.1, 1.0e4, 1.0, 1.0, 1.0])
"""Sizes of the rates of the integration state."""


@dataclass(frozen=True)
class OperatingPoint:
    """An equilibrium of the plant.

    Attributes
    ----------
    name : str
    inputs : (n,) array, n from 4 to N_INPUTS
        In the order of `ac_plant_node.inputs.INPUTS`: compressor speed rad/s, valve opening 0..1, evaporator air kg/s,
        its inlet temperature degC, and as many of the others as were given.
    outputs : (4,) array
        p_e Pa, SH K, T_w degC, p_c Pa.
    state : (12,) array
        The paper's state x: zeta_e1, p_e, h_e2, T_e1w, T_e2w, zeta_c1, zeta_c2, p_c, h_c3, T_c1w, T_c2w, T_c3w (SI).
    conserved : (12,) array
        The same state in the coordinates of the integration, see `ac_plant_node.dynamics.balances`.
    mass_flow_kg_s, cooling_power_w, compressor_power_w, subcooling_k, discharge_enthalpy_j_kg : float
    """

    name: str
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]
    state: NDArray[np.float64] = field(repr=False)
    conserved: NDArray[np.float64] = field(repr=False)
    mass_flow_kg_s: float = 0.0
    cooling_power_w: float = 0.0
    compressor_power_w: float = 0.0
    subcooling_k: float = 0.0
    discharge_enthalpy_j_kg: float = 0.0

    @property
    def cop(self) -> float:
        """Return cooling power over compressor power."""
        return self.cooling_power_w / self.compressor_power_w


def rates(
    x: NDArray[np.float64],
    inputs: NDArray[np.float64],
    parameters: Parameters,
    tab: Tables,
    faults: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return integration state, its rates and the auxiliary results at a public state x with all five zones.

    `x` is taken as that of the healthy plant: faults (N_FAULTS,) act on the integration state that belongs to it.
    """
    guess, z, ds, aux = balances.new_workspace()
    s = np.zeros(balances.N_STATES)
    balances.conserved(x, parameters.values, tab, s)
    guess[:] = x[1], x[7]
    balances.rhs(s, drive(inputs, parameters, faults), parameters.values, tab, guess, z, ds, aux)
    return s, ds, aux


def equilibrium(
    inputs: NDArray[np.float64],
    parameters: Parameters | None = None,
    start: NDArray[np.float64] | None = None,
    name: str = "",
) -> OperatingPoint:
    """Find the equilibrium that constant inputs lead to, all five zones present.

    Parameters
    ----------
    inputs : (n,) array, n from 4 to N_INPUTS
        As in `OperatingPoint.inputs`; those left out are the parameters' own (dry air at the evaporator).
    parameters : Parameters, optional
    start : (12,) array, optional
        State x to start from; a guess from the inputs otherwise.
    name : str

    Raises
    ------
    UserError
        When neither damped Newton iterations nor a simulation of 1500 s find an equilibrium with all five zones.
    """
    parameters = parameters or load_parameters()
    tab = load_tables(parameters.refrigerant)
    w = np.array(inputs, dtype=float)
    starts = [start] if start is not None else _starts(w, tab)
    for x0 in starts:
        x = _newton(np.array(x0), w, parameters, tab)
        if x is not None:
            return _describe(name, x, w, parameters, tab)
    x = _newton(_settled(np.array(starts[0]), w, parameters, tab), w, parameters, tab)
    if x is not None:
        return _describe(name, x, w, parameters, tab)
    raise UserError(
        f"no equilibrium with all zones found at {w[0] / RPM:g} rpm, {100 * w[1]:g} % valve, "
        f"{w[2]:g} kg/s air of {w[3]:g} degC"
    )


def _starts(w: NDArray[np.float64], tab: Tables) -> list[NDArray[np.float64]]:
    out = []
    for pe, pc in ((2.6e5, 1.3e6), (3.2e5, 1.1e6), (2.1e5, 1.8e6), (3.5e5, 1.5e6), (1.6e5, 1.3e6)):
        out.append(starting_state(tab, pe, superheated_enthalpy(tab, pe, 15.0), pc, float(w[3])))
    return out


def _settled(
    x: NDArray[np.float64], w: NDArray[np.float64], parameters: Parameters, tab: Tables
) -> NDArray[np.float64]:
    """Return the state after 1500 s of simulation from about `x` with the right charge."""
    low, high = 0.02, 0.98 - x[5]
    s = np.zeros(balances.N_STATES)
    for _ in range(50):  # less two-phase, more subcooled length: more charge
        x[6] = 0.5 * (low + high)
        balances.conserved(x, parameters.values, tab, s)
        low, high = (x[6], high) if s[0] + s[5] > parameters["charge_kg"] else (low, x[6])
    work = integrator.new_work(s)
    integrator.run(work, parameters.values, tab, held_inputs(w, parameters), 1500.0, np.empty(4))
    return workspace.views(work).aux[:12].copy()


def _residual(x: NDArray[np.float64], w: NDArray[np.float64], p: Parameters, tab: Tables) -> NDArray[np.float64]:
    s, ds, _ = rates(x, w, p, tab)
    out: NDArray[np.float64] = ds / RATE_SCALE
    out[5] = (s[0] + s[5] - p["charge_kg"]) / 1.0e-3
    return out


def _newton(x: NDArray[np.float64], w: NDArray[np.float64], p: Parameters, tab: Tables) -> NDArray[np.float64] | None:
    """Solve by Newton's method on x, steps cut to stay inside the five-zone form; None when it does not converge."""
    for iteration in range(80):
        r = _residual(x, w, p, tab)
        if not np.all(np.isfinite(r)):
            return None
        jac = np.empty((12, 12))
        for j in range(12):
            e = np.zeros(12)
            e[j] = 1.0e-6 * X_SCALE[j]
            jac[:, j] = (_residual(x + e, w, p, tab) - _residual(x - e, w, p, tab)) / 2.0e-6
        try:
            step = -np.linalg.solve(jac, r)
        except np.linalg.LinAlgError:
            return None
        size = float(np.max(np.abs(step)))
        x = _inside(x + step * min(1.0, 1.0 / max(size, 1e-300)) * X_SCALE)
        if size < 1.0e-11 or (size < 1.0e-9 and iteration > 12):
            return x if float(np.max(np.abs(_residual(x, w, p, tab)))) < 1.0e-6 and _five_zones(x) else None
    return None


def _inside(x: NDArray[np.float64]) -> NDArray[np.float64]:
    x = x.copy()
    x[0] = min(max(x[0], 0.05), 0.995)
    x[5] = min(max(x[5], 0.005), 0.6)
    x[6] = min(max(x[6], 0.02), 0.995 - x[5])
    x[1] = min(max(x[1], 3.0e4), 1.5e6)
    x[7] = min(max(x[7], 2.0e5), 3.4e6)
    return x


def _five_zones(x: NDArray[np.float64]) -> bool:
    return bool(0.0 < x[0] < 1.0 and x[5] > 0.0 and x[6] > 0.0 and x[5] + x[6] < 1.0)


def _describe(name: str, x: NDArray[np.float64], w: NDArray[np.float64], p: Parameters, tab: Tables) -> OperatingPoint:
    s, _, aux = rates(x, w, p, tab)
    outputs = np.array([x[1], aux[balances.SUPERHEAT], aux[balances.WALL_E2] - 273.15, x[7]])
    for array in (x, s, w, outputs):
        array.setflags(write=False)
    return OperatingPoint(
        name, w, outputs, x, s, float(aux[balances.M_COMPRESSOR]), float(aux[balances.Q_AIR_E]),
        float(aux[balances.POWER]), float(aux[balances.SUBCOOLING]), float(aux[balances.H_DISCHARGE]),
    )  # fmt: skip


def table_inputs(point: str, parameters: Parameters | None = None) -> NDArray[np.float64]:
    """Return the inputs of one of the parameters' operating points: of a row of Table I for the shipped ones.

    Raises
    ------
    UserError
        When there is no such point.
    """
    parameters = parameters or load_parameters()
    for row in parameters.points:
        if row.name == point:
            return row_inputs(row, parameters)
    known = ", ".join(row.name for row in parameters.points)
    raise UserError(f"unknown operating point {point!r}: allowed are {known}")


def operating_point(point: str) -> OperatingPoint:
    """Return the equilibrium of an operating point ("low", "med", "high"), solved once per process and plant.

    Raises
    ------
    UserError
        When there is no such point, or no equilibrium.
    """
    return _of_table(point, load_parameters().identity)


@cache
def _of_table(point: str, _plant: str) -> OperatingPoint:
    return equilibrium(table_inputs(point), name=point)
