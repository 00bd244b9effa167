"""Real processes over real DDS, on a ROS domain of their own."""

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("robust", deadline=None)
settings.load_profile("robust")


@pytest.fixture(scope="session", autouse=True)
def _own_domain() -> Iterator[None]:
    """Keep out of the way of whatever else runs on this machine."""
    before = os.environ.get("ROS_DOMAIN_ID")
    os.environ["ROS_DOMAIN_ID"] = str(10 + os.getpid() % 40)
    yield
    if before is None:
        del os.environ["ROS_DOMAIN_ID"]
    else:
        os.environ["ROS_DOMAIN_ID"] = before
