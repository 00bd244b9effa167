"""What comes back of q: next to nothing from the plant that the observer knows, more the less it is that plant."""

import pytest

from ac_design.analysis.mismatch import feedback
from fdi_node.envelope.unknowns import UNCERTAIN

VALVE = next(one for one in UNCERTAIN if one.name == "valve_discharge_coefficient")


@pytest.mark.parametrize("point", ["med"])
def test_q_comes_back_through_what_the_model_does_not_know(point: str) -> None:
    known, off, far_off = (feedback(point, one).radius for one in (None, VALVE, VALVE._replace(scale=0.08)))
    assert known < 0.02
    assert known < off < 0.2
    assert off < far_off
