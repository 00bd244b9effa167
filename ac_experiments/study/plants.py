"""Plants that are off: parameters by their standard deviations, told neither to the designs nor to the observer."""

import math
from collections.abc import Mapping

from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters
from fdi_node.envelope.unknowns import UNCERTAIN

#: Standard deviation of the logarithm of each parameter that may be off.
SIGMAS: dict[str, float] = {one.name: one.scale for one in UNCERTAIN}


def plant_off_by(deviations: Mapping[str, float]) -> Parameters | None:
    """Return the plant in use with parameters off by so many of their standard deviations; None when none is."""
    if not deviations:
        return None
    usual = load_parameters()
    off = {name: usual[name] * math.exp(SIGMAS[name] * many) for name, many in deviations.items()}
    return usual.replace(None, **off)
