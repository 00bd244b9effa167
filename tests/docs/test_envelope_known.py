"""What is left of a fault that is known as soon as it shows."""

import numpy as np
import pytest

from ac_common.units import RPM
from ac_experiments.designs import EnvelopeDesigns, designs_of
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from docs.tools.envelope_known import FAULT, ONSET_S, SIZE_RPM, left, told


def test_a_fault_that_is_told_is_taken_back_from_the_tick_in_which_it_shows_on() -> None:
    drive, healthy = (load("drive:7", [f"duration_s={ONSET_S + 100.0:g}", *more]) for more in ([FAULT], []))
    designs = designs_of(drive)
    assert isinstance(designs, EnvelopeDesigns)
    plain, known = simulate(healthy, True, designs=designs, diagnose=False), told(drive, designs)
    command = (known["controller/command:compressor"] - plain.series["controller/command:compressor"]) / RPM
    unseen = plain.time_s <= ONSET_S
    assert np.array_equal(known["plant/evaporator_pressure"][unseen], plain.series["plant/evaporator_pressure"][unseen])
    assert np.abs(command[unseen]).max() == 0.0
    assert command[-1] == pytest.approx(-SIZE_RPM, abs=0.5)
    alone = simulate(drive, True, designs=designs, diagnose=False).series["controller/command:compressor"]
    acts = np.flatnonzero(known["controller/command:compressor"] != alone)
    assert ONSET_S < plain.time_s[acts[0]] < ONSET_S + 3.0 * drive.sample_time_s
    assert left(known, plain)[1] < 0.1
