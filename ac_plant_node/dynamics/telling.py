"""A step of the plant and what a run records of it, in one call of compiled code."""

from ac_plant_node.dynamics.balances import DRAINED, FROST, LATENT, POWER, Q_AIR_E, SUBCOOLING, WATER
from ac_plant_node.dynamics.drive import outlet_air
from ac_plant_node.dynamics.integrator import run
from ac_plant_node.dynamics.workspace import views
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

N_OUTPUTS, N_TOLD = 4, 11


@jit
def run_and_tell(
    work: Array, par: Array, sat: Array, vapour: Array, isentrope: Array, liquid: Array, grid: Array,
    inputs: Array, duration_s: float, out: Array,
) -> int:  # fmt: skip
    """Do as `ac_plant_node.dynamics.integrator.run`, with the fields of `ac_common.signals.Performance` behind `out`.

    Parameters
    ----------
    work, par, inputs, duration_s
        As there.
    sat, vapour, isentrope, liquid, grid : array
        The fields of `Tables`: a tuple of arrays takes longer to hand over than the arrays do.
    out : (N_TOLD,) array
        Results.

    Returns
    -------
    int
        As there; unless it is 0 the performance stays what it was.
    """
    tab = Tables(sat, vapour, isentrope, liquid, grid)
    status = run(work, par, tab, inputs, duration_s, out[:N_OUTPUTS])
    if status != 0:
        return status
    k = views(work)
    a, told = k.aux, out[N_OUTPUTS:]
    told[0], told[1], told[2], told[3] = a[Q_AIR_E], a[LATENT], a[WATER], a[FROST]
    told[4], told[6] = a[POWER], a[SUBCOOLING]
    told[5], _ = outlet_air(k.drive, par, a[Q_AIR_E], a[WATER], a[DRAINED])
    return 0
