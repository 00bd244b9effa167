"""Where the designs of all blocks are looked up and kept: computed once for each content that they depend on."""

import importlib
import math
import sys
from dataclasses import asdict
from typing import Any

from ac_common.cache import Arrays, cached, source_fingerprint
from ac_common.sample_time import LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S
from ac_plant_node import parameters_fingerprint

PACKAGES = ("gimc", "ac_plant_node", "fdi_node", "gimc_controller_node")


def cached_design(block: str, synthesis: str, point: str, sample_time_s: float, *weights: Any) -> Arrays:
    """Sampled design of one block at one operating point.

    Parameters
    ----------
    block : str
        Name for the file.
    synthesis : str
        Module with `synthesise(point, sample_time_s, *weights) -> Arrays`; imported only when there is nothing in the
        cache, since synthesis needs far more memory and start-up time than a running node should take.
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    *weights : dataclass

    Raises
    ------
    ValueError
        For a sample time out of range or an unknown point.
    """
    if not (math.isfinite(sample_time_s) and SHORTEST_SAMPLE_TIME_S <= sample_time_s <= LONGEST_SAMPLE_TIME_S):
        allowed = f"{SHORTEST_SAMPLE_TIME_S:g} to {LONGEST_SAMPLE_TIME_S:g} s"
        raise ValueError(f"sample time {sample_time_s:g} s: designs exist for {allowed}")
    key = {
        "point": point,
        "sample_time_s": sample_time_s,
        "weights": [asdict(w) for w in weights],
        "plant": parameters_fingerprint(),
        "code": source_fingerprint(*PACKAGES),
    }

    def compute() -> Arrays:
        from threadpoolctl import threadpool_limits

        print(f"acftc: designing the {block} at {point} (once, some seconds)", file=sys.stderr, flush=True)
        module = importlib.import_module(synthesis)
        with threadpool_limits(1):  # matrices of this size are ten times slower on several threads
            arrays: Arrays = module.synthesise(point, sample_time_s, *weights)
        return arrays

    return cached(f"{block}-{point}", key, compute)
