"""Runs with a fault so small that its name is sure only later, or never."""

from functools import cache

from ac_common.fdi_status import StatusRow
from ac_experiments.recording import Recording
from ac_experiments.scenario import check, load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate

ONSET_S = 60.0
SENSOR = {"kind": "evaporator_pressure", "size_kpa": 0.35, "onset_s": ONSET_S}
#: It has the sensor's name, which is never sure.
COMPRESSOR = {"kind": "compressor_speed", "size_rpm": 5.0, "onset_s": ONSET_S}


def with_small(fault: dict[str, object]) -> Scenario:
    """Return two and a half minutes at the high operating point, with the noise of the drives."""
    noise = load("drive:0").noise.model_dump(exclude_none=True)
    about = {"name": "small", "design": "envelope", "operating_point": "high", "duration_s": 150.0}
    return check({**about, "noise": noise, "faults": [fault]})


@cache
def sure_later() -> Recording:
    """Return a run in which the right name is sure some seconds after it has been given."""
    return simulate(with_small(SENSOR))


@cache
def never_sure() -> Recording:
    """Return a run in which the wrong name is given, and is never sure."""
    return simulate(with_small(COMPRESSOR))


def lost_between(status: list[StatusRow], lost_s: float, again_s: float) -> list[StatusRow]:
    """Return what a decision says that is not sure of the name between two times."""
    return [row._replace(unsure=row.isolated) if lost_s <= round(row.time_s, 1) < again_s else row for row in status]
