"""Steps of one control interval with inputs that jump at each, against scipy's Radau on the same right-hand side.

The exponential steps in particular: a tighter tolerance of our own is no independent reference for them.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ac_plant_node import POINTS, Plant, operating_point
from ac_plant_node.dynamics import balances
from ac_plant_node.dynamics.drive import drive
from ac_plant_node.dynamics.workspace import ERROR_SCALE
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.properties.tables import load_tables

T = 0.1
TICKS = 60
#: What noise makes of the commands in the closed loop (docs/control.md), rad/s and 0..1 rms.
JUMPS = {"low": (1.05, 0.004), "med": (0.85, 0.0035), "high": (0.5, 0.001)}


def jumping(point: str) -> NDArray[np.float64]:
    """Inputs as noise in the closed loop makes them, on a slow ramp of the speed; (TICKS, 4)."""
    random = np.random.default_rng(11)
    inputs = np.tile(operating_point(point).inputs, (TICKS, 1))
    inputs[:, 0] *= 1.0 + np.linspace(0.0, 0.03, TICKS)
    return inputs + random.standard_normal(inputs.shape) * [*JUMPS[point], 0.0, 0.0]


def by_radau(point: str, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outputs of `Plant.step` for each row, (TICKS, 4)."""
    par = load_parameters()
    tab = load_tables(par.refrigerant)
    guess, z, ds, aux = balances.new_workspace()
    state, outputs = np.array(operating_point(point).conserved), []
    for w in [drive(held, par) for held in inputs]:

        def rates(_t: float, s: NDArray[np.float64], w: NDArray[np.float64] = w) -> NDArray[np.float64]:
            balances.rhs(s, w, par.values, tab, guess, z, ds, aux)
            return ds.copy()

        state = solve_ivp(rates, (0.0, T), state, method="Radau", rtol=1e-9, atol=1e-9 * ERROR_SCALE).y[:, -1]
        rates(0.0, state)
        outputs.append([aux[balances.P_E], aux[balances.SUPERHEAT], aux[balances.WALL_E2] - 273.15, aux[balances.P_C]])
    return np.array(outputs)


@pytest.mark.parametrize("point", POINTS)
def test_inputs_that_jump_at_every_interval(point):
    inputs, plant = jumping(point), Plant.at(point)
    off = np.abs([plant.step(held, T) for held in inputs] - by_radau(point, inputs)).max(axis=0)
    # A fiftieth of the noise of the pressure sensor, a fifth of that of the temperatures; p_c, which has none, to 2e-5.
    assert off[0] < 4.0
    assert off[1] < 0.02
    assert off[2] < 0.01
    assert off[3] < 2e-5 * operating_point(point).outputs[3]
