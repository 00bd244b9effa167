"""What a tick of the loop makes: the series, and in which columns of a run's array they are."""

from itertools import accumulate, chain

from ac_common.faults import ISOLABLE_KINDS, STICKING
from ac_common.signals import Inlets, Innovation, Measurement, PlantOutput, topics_of
from ac_common.topics import BY_NAME, PERFORMANCE_SERIES, residual_of, truth_of

_ACTUATORS = tuple(BY_NAME["controller/command"].joints)
_GROUPS = (
    topics_of("plant", PlantOutput),
    topics_of("plant", Inlets),
    PERFORMANCE_SERIES,
    topics_of("measured", Measurement),
    topics_of("measured", Inlets),
    topics_of("fdi/innovation", Innovation),
    tuple(residual_of(kind) for kind in ISOLABLE_KINDS),
    tuple(f"compensator/q:{joint}" for joint in _ACTUATORS),
    tuple(f"controller/command:{joint}" for joint in _ACTUATORS),
    tuple(f"actuator/command:{joint}" for joint in _ACTUATORS),
    BY_NAME["component/faults"].series,
    tuple(truth_of(fault.kind) for fault in STICKING),
)
_OUTPUTS, INLETS, PERFORMANCE, READINGS, INLETS_READ, INNOVATION, RESIDUAL, *_more = accumulate(
    map(len, _GROUPS), initial=0
)
Q_MADE, COMMANDED, ACTUATOR, FAULTS, STUCK, _END = _more
"""Where each of the groups begins; `FAULTS`: those of components, `STUCK`: of readings that may stand still."""
MADE: tuple[str, ...] = tuple(chain(*_GROUPS))
DIAGNOSED = MADE[INNOVATION:COMMANDED]
"""Series of detector and compensator."""
