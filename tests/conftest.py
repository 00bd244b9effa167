"""What all tests share: settings of the mathematics and of property-based tests, and a ROS domain of their own."""

import os
from collections.abc import Iterator

# Matrices here are small: several BLAS threads make the linear algebra ten times slower. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

# The first call of much takes its time: a compiled function, a message of a type, a file from the disk.
settings.register_profile("here", deadline=None)
settings.load_profile("here")


@pytest.fixture(scope="session", autouse=True)
def _own_domain() -> Iterator[None]:
    """Keep out of the way of whatever else runs on this machine: domains 10 to 99, one for each process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(10 + os.getpid() % 90))
        yield
