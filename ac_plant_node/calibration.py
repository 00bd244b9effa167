"""Inverse calibration: the maps of compressor and valve that make the paper's Table I exact equilibria.

At each operating point the evaporator pressure and the superheat are given, so the enthalpy at the evaporator's outlet
is. The remaining states are solved for together with the volumetric efficiency and the valve area that hold the point
at rest with the given charge; three points then fix the two three-coefficient maps

``eta_v = a + b (p_c/p_e - 4) + c (1 - 1000 rpm / N)`` and ``A_v = a_0 + a_1 u + a_2 u^2``.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_plant_node.dynamics import balances
from ac_plant_node.dynamics.drive import default_held, drive
from ac_plant_node.inputs import INPUT, INPUTS, N_INPUTS, N_PAPER, TO_SI
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import NAMES, SOLVED, TABLE_I, Parameters, TableRow, parameter_range, shipped
from ac_plant_node.properties.lookup import saturation, vapour
from ac_plant_node.properties.tables import VAPOUR_SPAN_J_KG, Tables, load_tables


class NoEquilibrium(UserError):  # noqa: N818  (reads as what it is)
    """At an operating point the plant cannot be at rest with these parameters."""

    def __init__(self, point: str) -> None:
        super().__init__(f"calibration: no equilibrium found for the {point!r} point with these parameters")


@dataclass(frozen=True)
class CalibratedPoint:
    """Result of the inverse calibration at one point: state x, volumetric efficiency, valve area."""

    row: TableRow
    state: NDArray[np.float64]
    eta_v: float
    valve_area_m2: float


def superheated_enthalpy(tab: Tables, p: float, superheat_k: float) -> float:
    """Return the enthalpy (J/kg) of vapour at pressure `p`, `superheat_k` above saturation, from the tables."""
    sat = saturation(tab, p)
    low, high = float(sat[2]), float(sat[2]) + VAPOUR_SPAN_J_KG
    while True:  # bisection to the last bit: no solver library to load, and no tolerance to choose
        h = 0.5 * (low + high)
        if not low < h < high:
            return h
        if vapour(tab, p, sat[14], h, sat[2], sat[9])[3] - sat[0] < superheat_k:
            low = h
        else:
            high = h


def starting_state(tab: Tables, pe: float, h_e2: float, pc: float, air_c: float) -> NDArray[np.float64]:
    """Return a plausible state x with five zones, to start a solver from."""
    te, tc = saturation(tab, pe)[0], saturation(tab, pc)[0]
    h_f = saturation(tab, pc)[1]
    wall_1, wall_2 = te + 3.0, 0.5 * (te + 3.0 + air_c + 273.15)
    return np.array([0.85, pe, h_e2, wall_1, wall_2, 0.12, 0.75, pc, h_f - 8.0e3, tc - 1.0, tc - 2.5, tc - 6.0])


def row_inputs(row: TableRow, parameters: Parameters) -> NDArray[np.float64]:
    """Return an operating point's inputs: (4,), or (N_INPUTS,) where a row tells of the condenser's air or humidity."""
    held = default_held(parameters)
    held[INPUT["air_mass_flow"]] = parameters["evaporator_air_nominal_kg_s"]
    told = [getattr(row, quantity.keyword) for quantity in INPUTS]
    for i, (quantity, value) in enumerate(zip(INPUTS, told, strict=True)):
        if value is not None:
            held[i] = TO_SI[quantity.unit](value)
    return held[: N_PAPER if told[N_PAPER:].count(None) == N_INPUTS - N_PAPER else N_INPUTS].copy()


def solve_point(row: TableRow, parameters: Parameters, tab: Tables) -> CalibratedPoint:
    """Solve for state, volumetric efficiency and valve area that hold one row of Table I at rest.

    Raises
    ------
    NoEquilibrium
        When the solver finds none: the parameters do not fit the point.
    """
    from scipy.optimize import root  # half a second to load, and only calibration needs it

    pe = row.evaporator_pressure_kpa * 1.0e3
    h_e2 = superheated_enthalpy(tab, pe, row.superheat_k)
    w = row_inputs(row, parameters)
    free = np.array([0, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    guess, z, ds, aux = balances.new_workspace()
    s = np.zeros(balances.N_STATES)
    # Rows: all rates but that of the condenser's mass, which is minus the evaporator's; in its place the charge.
    row_scale = np.array([1e-2, 1e3, 1e4, 1.0, 1.0, 1.0, 1e3, 0.1, 1e4, 1.0, 1.0, 1.0])
    unknown_scale = np.array([0.1, 1.0, 1.0, 0.1, 0.1, 1e5, 1e4, 1.0, 1.0, 1.0, 0.1, 1e-7])

    def residual(q: NDArray[np.float64]) -> NDArray[np.float64]:
        values = q * unknown_scale
        x = np.empty(balances.N_STATES)
        x[free], x[1], x[2] = values[:10], pe, h_e2
        trial = parameters.replace(
            eta_v_offset=values[10], eta_v_pressure_ratio=0.0, eta_v_speed=0.0,
            valve_area_0_m2=values[11], valve_area_1_m2=0.0, valve_area_2_m2=0.0,
        )  # fmt: skip
        balances.conserved(x, trial.values, tab, s)
        guess[:] = pe, x[7]
        balances.rhs(s, drive(w, trial), trial.values, tab, guess, z, ds, aux)
        out: NDArray[np.float64] = ds / row_scale
        out[5] = (s[0] + s[5] - parameters["charge_kg"]) / 1e-2
        return out

    best = None
    for pc in (1.1e6, 1.35e6, 1.8e6):
        x0 = starting_state(tab, pe, h_e2, pc, row.air_inlet_temperature_c)
        q0 = np.concatenate([x0[free], [0.7, 8.0e-7]]) / unknown_scale
        found = root(residual, q0, method="hybr", options={"xtol": 1e-13, "maxfev": 4000})
        error = float(np.max(np.abs(residual(found.x))))
        q = found.x * unknown_scale
        if error < 1e-7 and 0 < q[0] < 1 and q[3] > 0 and q[4] > 0 and q[3] + q[4] < 1:
            best = q
            break
    if best is None:
        raise NoEquilibrium(row.name)
    x = np.empty(balances.N_STATES)
    x[free], x[1], x[2] = best[:10], pe, h_e2
    return CalibratedPoint(row, x, float(best[10]), float(best[11]))


def _solved(row: TableRow, parameters: Parameters, tab: Tables) -> CalibratedPoint:
    """Return what `solve_point` does, or say which number of the row, or which parameter, is to blame."""
    try:
        return solve_point(row, parameters, tab)
    except NoEquilibrium as problem:
        raise UserError(f"{problem}; {_blamed(row, parameters, tab)}") from None


def _blamed(row: TableRow, parameters: Parameters, tab: Tables) -> str:
    """Return in words what keeps a point from being at rest.

    A superheat that the air cannot give; else a parameter without whose change from the shipped set there is an
    equilibrium; else a number of the row without whose change from the shipped point of the nearest air there is.
    """
    boils_c = saturation(tab, row.evaporator_pressure_kpa * 1.0e3)[0] - 273.15
    if boils_c + row.superheat_k >= row.air_inlet_temperature_c:
        return (
            f"at {row.evaporator_pressure_kpa:g} kPa the refrigerant boils at {boils_c:.1f} degC: "
            f"{row.superheat_k:g} K of superheat are not to be had from air of {row.air_inlet_temperature_c:g} degC"
        )
    usual = {name: float(shipped()[name]["value"]) for name in NAMES if name not in SOLVED}
    changed = [name for name in usual if parameters[name] != usual[name]]
    curing = [name for name in changed if _is_at_rest(row, _with(parameters, name, usual[name]), tab)]
    if curing:
        told = ", ".join(f"{name} {parameters[name]:g} (shipped: {usual[name]:g})" for name in curing)
        return f"with the shipped value of one of these there would be one: {told}"
    typical = min(TABLE_I, key=lambda known: abs(known.air_inlet_temperature_c - row.air_inlet_temperature_c))
    numbers = [name for name in _ROW_NUMBERS if getattr(row, name) != getattr(typical, name)]
    curing = [name for name in numbers if _is_at_rest(replace(row, **{name: getattr(typical, name)}), parameters, tab)]
    if curing:
        told = ", ".join(f"{name} {getattr(row, name):g} (at {getattr(typical, name):g} there is)" for name in curing)
        return f"one of these numbers of the row is to blame: {told}"
    return "no single number is to blame: look at the sizes of heat exchangers, charge and displacement together"


#: Numbers of a row that may be to blame.
_ROW_NUMBERS = ("evaporator_pressure_kpa", "superheat_k", "compressor_speed_rpm", "valve_opening_percent")


def _with(parameters: Parameters, name: str, value: float) -> Parameters:
    changed: dict[str, Any] = {name: value}
    return parameters.replace(**changed)


def _is_at_rest(row: TableRow, parameters: Parameters, tab: Tables) -> bool:
    try:
        solve_point(row, parameters, tab)
    except NoEquilibrium:
        return False
    return True


def doubtful(parameters: Parameters) -> list[str]:
    """Return what is wrong with solved coefficients, a sentence each: a sign that no plant of this kind has."""
    slope = parameters["eta_v_pressure_ratio"]
    opening = np.array([row.valve_opening_percent / 100.0 for row in parameters.points])
    growth = parameters["valve_area_1_m2"] + 2.0 * parameters["valve_area_2_m2"] * opening
    found = []
    if slope > 0.0:
        found.append(
            f"eta_v_pressure_ratio is {slope:+.3g}: a volumetric efficiency that grows with the pressure ratio is not "
            "physical; a pressure, a speed or a size among the numbers given is wrong"
        )
    if growth.min() <= 0.0:
        at = 100.0 * float(opening[growth.argmin()])
        found.append(f"at {at:g} % the valve's area falls as it opens: two openings of the points may be mixed up")
    return found


def calibrate(
    parameters: Parameters | None = None, tab: Tables | None = None, rows: tuple[TableRow, ...] | None = None
) -> tuple[Parameters, list[CalibratedPoint]]:
    """Compute the maps of compressor and valve from a table of operating points.

    Three points fix the two maps exactly; more are fitted by least squares.

    Parameters
    ----------
    parameters : Parameters, optional
        Everything but the six solved coefficients is taken from here; the shipped set by default.
    tab : Tables, optional
        Tables of the set's refrigerant.
    rows : tuple of TableRow, optional
        The operating points, at least three; those of the parameters by default, which are Table I's.

    Returns
    -------
    tuple
        The parameters with the solved coefficients and the operating points, and the result at each point.

    Raises
    ------
    UserError
        One line: the point without an equilibrium, or the coefficient outside its range.
    """
    parameters = parameters or load_parameters()
    tab = tab or load_tables(parameters.refrigerant)
    rows = parameters.points if rows is None else rows
    points = [_solved(row, parameters, tab) for row in rows]
    ratio = np.array([p.state[7] / p.state[1] for p in points])
    speed = np.array([1.0 - 1000.0 / p.row.compressor_speed_rpm for p in points])
    eta = _fit(np.column_stack([np.ones(len(points)), ratio - 4.0, speed]), [p.eta_v for p in points])
    u = np.array([p.row.valve_opening_percent / 100.0 for p in points])
    area = _fit(np.vander(u, 3, increasing=True), [p.valve_area_m2 for p in points])
    found = dict(zip(SOLVED, (*eta, *area), strict=True))
    for name, value in found.items():
        low, high = parameter_range(name)
        if not low <= value <= high:
            raise UserError(
                f"calibration: {name} comes out as {value:.3g}, outside {low:g} to {high:g}; "
                "these operating points do not belong to a plant with these parameters"
            )
    return replace(parameters.replace(**found), points=rows), points


def _fit(matrix: NDArray[np.float64], values: list[float]) -> NDArray[np.float64]:
    """Return the exact solution for three points, that of least squares for more."""
    found: NDArray[np.float64]
    if len(values) == matrix.shape[1]:
        try:
            found = np.linalg.solve(matrix, values)
        except np.linalg.LinAlgError:
            found = np.full(matrix.shape[1], np.nan)
    else:
        found, _, rank, _ = np.linalg.lstsq(matrix, np.array(values), rcond=None)
        if rank < matrix.shape[1]:
            found[:] = np.nan
    if not np.isfinite(found).all():
        raise UserError("calibration: the operating points must differ in compressor speed and in valve opening")
    return found
