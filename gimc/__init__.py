"""Mathematics of the generalised internal model control (GIMC) structure: python-control's StateSpace in and out.

Coprime factors, H-infinity synthesis, model matching, order reduction, norms and sampled filters. Nothing in here knows
about air conditioners or ROS.
"""

from gimc.coprime import coprime_factor, filter_gain, lcf
from gimc.errors import (
    IllPosedError,
    ImaginaryAxisZeroError,
    InfeasibleError,
    NormMismatchError,
    NotDetectableError,
    NotStabilisableError,
    RankDeficientD12Error,
    RankDeficientD21Error,
    RiccatiError,
    SynthesisError,
    UnstableError,
)
from gimc.hinfsyn import HinfResult, hinf_synthesis, hinfsyn
from gimc.interconnect import (
    Abcd,
    abcd,
    add,
    append,
    connect,
    generalised_plant,
    inverse,
    lft,
    scale,
    series,
    stack_inputs,
    stack_outputs,
    state_space,
)
from gimc.model_matching import (
    Matching,
    isolation_filter,
    isolation_synthesis,
    matching_lower_bound,
    model_matching,
    regularise,
)
from gimc.norms import frequency_response, hinf_norm, is_stable, largest_singular_values, poles, sweep_norm
from gimc.reduction import Reduction, balanced_truncation, hankel_values, minimal_realisation, reduce_order
from gimc.riccati import care
from gimc.sampled import (
    ObserverDesign,
    Sampled,
    SampledFilter,
    SampledObserver,
    discretise,
    sampled_observer,
    sampling_error,
)

__all__ = [
    "Abcd",
    "HinfResult",
    "IllPosedError",
    "ImaginaryAxisZeroError",
    "InfeasibleError",
    "Matching",
    "NormMismatchError",
    "NotDetectableError",
    "NotStabilisableError",
    "ObserverDesign",
    "RankDeficientD12Error",
    "RankDeficientD21Error",
    "Reduction",
    "RiccatiError",
    "Sampled",
    "SampledFilter",
    "SampledObserver",
    "SynthesisError",
    "UnstableError",
    "abcd",
    "add",
    "append",
    "balanced_truncation",
    "care",
    "connect",
    "coprime_factor",
    "discretise",
    "filter_gain",
    "frequency_response",
    "generalised_plant",
    "hankel_values",
    "hinf_norm",
    "hinf_synthesis",
    "hinfsyn",
    "inverse",
    "is_stable",
    "isolation_filter",
    "isolation_synthesis",
    "largest_singular_values",
    "lcf",
    "lft",
    "matching_lower_bound",
    "minimal_realisation",
    "model_matching",
    "poles",
    "reduce_order",
    "regularise",
    "sampled_observer",
    "sampling_error",
    "scale",
    "series",
    "stack_inputs",
    "stack_outputs",
    "state_space",
    "sweep_norm",
]
