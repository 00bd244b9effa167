"""Linearisation of the plant at an operating point."""

from functools import cache

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, null_space

from ac_plant_node.dynamics import balances as model
from ac_plant_node.equilibrium import X_SCALE, OperatingPoint, operating_point, rates
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.properties.tables import load_tables

INPUTS = ("compressor_speed", "valve_opening", "air_mass_flow", "air_inlet_temperature")
"""Inputs of the linear model: rad/s, 0..1, kg/s, K."""
OUTPUTS = ("evaporator_pressure", "superheat", "wall_temperature")
"""Outputs of the linear model: Pa, K, K."""

_INPUT_STEP = np.array([1.0e-2, 1.0e-4, 1.0e-5, 1.0e-2])
_REL_STEP = 3.0e-6


def descriptor(point: OperatingPoint) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the Jacobians of the twelve-state model in the paper's state x at an equilibrium.

    With the integration state ``s = s(x)`` and its rates ``f(x, w)`` the model is ``K dx/dt = f``, ``K = ds/dx``, hence
    ``A = K^-1 df/dx`` and ``B = K^-1 df/dw``.

    Returns
    -------
    tuple
        A (12, 12), B (12, 4), and the row ``dM/dx`` (12,), the gradient of the refrigerant mass: a left null vector
        of A and of B, because the charge is conserved whatever the inputs do.
    """
    parameters = load_parameters()
    tab = load_tables(parameters.refrigerant)
    x0, w0 = point.state, point.inputs
    k = np.empty((12, 12))
    f_x = np.empty((12, 12))
    f_w = np.empty((12, 4))
    for j in range(12):
        e = np.zeros(12)
        e[j] = _REL_STEP * X_SCALE[j]
        s_up, f_up, _ = rates(x0 + e, w0, parameters, tab)
        s_dn, f_dn, _ = rates(x0 - e, w0, parameters, tab)
        k[:, j] = (s_up - s_dn) / (2.0 * e[j])
        f_x[:, j] = (f_up - f_dn) / (2.0 * e[j])
    for j in range(4):
        e = np.zeros(4)
        e[j] = _INPUT_STEP[j]
        f_w[:, j] = (rates(x0, w0 + e, parameters, tab)[1] - rates(x0, w0 - e, parameters, tab)[1]) / (2.0 * e[j])
    # The condenser's mass rate is minus the evaporator's: say so exactly instead of to the accuracy of differences.
    f_x[5], f_w[5] = -f_x[0], -f_w[0]
    return np.linalg.solve(k, f_x), np.linalg.solve(k, f_w), k[0] + k[5]


def output_jacobian(point: OperatingPoint) -> NDArray[np.float64]:
    """Return the Jacobian (3, 12) of p_e, SH and T_w = T_e2w with respect to x."""
    parameters = load_parameters()
    tab = load_tables(parameters.refrigerant)
    c = np.zeros((3, 12))
    c[0, 1] = 1.0
    c[2, 4] = 1.0
    for j in (1, 2):
        e = np.zeros(12)
        e[j] = 1.0e-4 * X_SCALE[j]
        up = rates(point.state + e, point.inputs, parameters, tab)[2][model.SUPERHEAT]
        down = rates(point.state - e, point.inputs, parameters, tab)[2][model.SUPERHEAT]
        c[1, j] = (up - down) / (2.0 * e[j])
    return c


def linearize(point: str | OperatingPoint) -> control.StateSpace:
    """Return the state-space model of the plant around an operating point, in deviations from it.

    The twelve-state Jacobian has one zero eigenvalue, the conserved charge, which no input reaches. Its left vector
    ``m = dM/dx`` is projected out: with ``x = T q``, the columns of T a basis of the plane ``m x = 0`` in scaled
    coordinates, eleven states remain and nothing is neglected. The states are then scaled (powers of two) so that the
    matrix is balanced.

    Parameters
    ----------
    point : str or OperatingPoint
        "low", "med", "high" or an equilibrium.

    Returns
    -------
    control.StateSpace
        11 states; inputs `INPUTS` (rad/s, 0..1, kg/s, K); outputs `OUTPUTS` (Pa, K, K).

    Raises
    ------
    ValueError
        For an unknown point.
    """
    return _of_table(point, load_parameters().identity) if isinstance(point, str) else _linearized(point)


@cache
def _of_table(point: str, _plant: str) -> control.StateSpace:
    return _linearized(operating_point(point))


def _linearized(at: OperatingPoint) -> control.StateSpace:
    a, b, m = descriptor(at)
    c = output_jacobian(at)
    scale = X_SCALE
    a, b, c, m = a / scale[:, None] * scale, b / scale[:, None], c * scale, m * scale
    basis = null_space(m[None, :])
    a, b, c = basis.T @ a @ basis, basis.T @ b, c @ basis
    balanced, (factors, permutation) = matrix_balance(a, separate=True)
    b, c = b[permutation] / factors[permutation, None], c[:, permutation] * factors[permutation]
    return control.ss(
        balanced, b, c, np.zeros((3, 4)), inputs=list(INPUTS), outputs=list(OUTPUTS), name=f"plant_{at.name or 'at'}"
    )
