"""Real processes over real DDS, on a ROS domain of their own."""

import os

import pytest


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep out of the way of whatever else runs on this machine."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(60 + os.getpid() % 40))
