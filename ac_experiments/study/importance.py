"""What matters: shares of a figure's variance by Sobol indices, or ranks that rise and fall together."""

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Vector = NDArray[np.float64]


class Importance(NamedTuple):
    """What one drawn value does to a figure.

    Attributes
    ----------
    name : str
    first, first_error : float
        Sobol's first-order index, and half the width of its 95 % interval; or Spearman's rank correlation, and half the
        width of the interval by Fisher's transformation.
    total, total_error : float
        Sobol's total index; nan with ranks.
    """

    name: str
    first: float
    first_error: float
    total: float
    total_error: float


def sobol_indices(names: Sequence[str], figure: Vector, seed: int) -> list[Importance]:
    """Return first-order and total indices from a figure at Saltelli's points (`sampling.saltelli`), by SALib."""
    from SALib.analyze import sobol

    problem = {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own future, and of a figure that does not change
        found = sobol.analyze(problem, figure, calc_second_order=False, seed=seed)
    rows = zip(names, *(found[key].tolist() for key in ("S1", "S1_conf", "ST", "ST_conf")), strict=True)
    return [Importance(*row) for row in rows]


def rank_correlations(drawn: Mapping[str, Vector], figure: Vector) -> list[Importance]:
    """Return Spearman's correlation of each drawn value with a figure, over the runs that have both."""
    rows = []
    for name, values in drawn.items():
        known = np.isfinite(values) & np.isfinite(figure)
        n = int(known.sum())
        if n < 5 or np.ptp(values[known]) == 0.0 or np.ptp(figure[known]) == 0.0:
            continue
        rho = float(stats.spearmanr(values[known], figure[known]).statistic)
        # Bonett and Wright, Psychometrika 65 (2000) 23: the variance of the transformed rank correlation.
        half = 1.96 * math.sqrt((1.0 + 0.5 * rho * rho) / (n - 3)) if n > 3 else math.inf
        z = math.atanh(max(min(rho, 1.0 - 1e-12), -1.0 + 1e-12))
        rows.append(Importance(name, rho, 0.5 * (math.tanh(z + half) - math.tanh(z - half)), math.nan, math.nan))
    return rows
