"""The observer under random inputs over the whole box, in air of unknown humidity: lost, and found again."""

import numpy as np
import pytest

from ac_common.faults import UNKNOWN
from bringup.benchmarks.observer_anywhere import NOISE, hour


@pytest.mark.parametrize("seed", [0, 1])
def test_observer_is_lost_and_found_again(seed: int) -> None:
    done = hour(seed, ticks=12000)
    assert done.is_finite
    np.testing.assert_allclose(done.rms, NOISE[:3], rtol=0.3)
    assert done.isolated in (None, UNKNOWN)
