"""What is drawn for each run: a point in the unit cube, from the seed and the run's number alone, and the values there.

The runs of one replicate (one for each cell of the grids) share what is not varied by key: the drive, and the seed of
the noise. So cells can be compared pairwise.
"""

import math
import warnings
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_experiments.study.schema import Study

Points = NDArray[np.float64]


class Sampler:
    """Draws the values of each run of a study.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: Study) -> None:
        self.study = study

    @cached_property
    def _points(self) -> Points:
        """All points of a sampling that fills the cube, (runs, d)."""
        return _filling(self.study)

    def point(self, run: int) -> Points:
        """Return where in the unit cube of `study.drawn` a run is, (d,)."""
        study = self.study
        if not study.drawn:
            return np.empty(0)
        if study.sampling == "random":
            return np.random.default_rng([study.seed, run]).random(len(study.drawn))
        return np.asarray(self._points[run])

    def values(self, run: int) -> dict[str, Any]:
        """Return what varies, by key, in the order of the file."""
        study, cell = self.study, run % self.study.cells
        shares = dict(zip(study.drawn, self.point(run).tolist(), strict=True))
        found: dict[str, Any] = {}
        for key, one in study.distributions.items():
            if one.is_grid:
                cell, place = divmod(cell, len(one.values))
                found[key] = one.values[place]
            else:
                found[key] = one.at(shares[key])
        return found

    def replicate(self, run: int) -> int:
        """Return which pass through the grids a run belongs to."""
        return run // self.study.cells

    def drive(self, run: int) -> int:
        """Return the seed of a run's drive, of the random family."""
        return self.study.seed + self.replicate(run)

    def noise_seed(self, run: int) -> int:
        """Return the seed of a run's noise, where the scenario is not a drive, whose noise has the drive's seed."""
        word = np.random.SeedSequence([self.study.seed, self.replicate(run), 1]).generate_state(1)[0]
        return int(word) & 0x7FFFFFFF


def _filling(study: Study) -> Points:
    """Return the points of a study whose sampling fills the unit cube, (runs, d)."""
    from scipy.stats import qmc

    dimensions, rng = len(study.drawn), generator(study.seed)
    if study.sampling == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, **rng).random(study.runs))
    if study.sampling == "sobol":
        with warnings.catch_warnings():
            # A number of runs that is no power of two is less even, which is no mistake.
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(qmc.Sobol(dimensions, **rng).random(study.runs))
    return saltelli(dimensions, study.runs // (dimensions + 2), study.seed)


def generator(seed: int) -> dict[str, np.random.Generator]:
    """Return the argument by which scipy is given random numbers, whose name was another one before 1.15."""
    from scipy import __version__

    name = "rng" if tuple(int(part) for part in __version__.split(".")[:2]) >= (1, 15) else "seed"
    return {name: np.random.default_rng(seed)}


def saltelli(dimensions: int, base: int, seed: int) -> Points:
    """Return Saltelli's points for Sobol indices, (base (d + 2), d): A, then A with one column of B each, then B.

    Saltelli et al., Computer Physics Communications 181 (2010) 259, in the order that SALib reads.
    """
    from scipy.stats import qmc

    both = qmc.Sobol(2 * dimensions, **generator(seed)).random_base2(round(math.log2(base)))
    first, second = both[:, :dimensions], both[:, dimensions:]
    blocks = [first]
    for column in range(dimensions):
        mixed = first.copy()
        mixed[:, column] = second[:, column]
        blocks.append(mixed)
    # SALib takes the rows of a base point one after another.
    return np.stack([*blocks, second], axis=1).reshape(-1, dimensions)
