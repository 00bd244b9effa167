"""What all tests share: settings of the mathematics and of property-based tests, and a ROS domain of their own."""

import os
from collections.abc import Iterator

# Matrices here are small: several BLAS threads make the linear algebra ten times slower. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

#: What pytest-xdist calls a process of its own.
WORKER = "PYTEST_XDIST_WORKER"

# The first call of much takes its time: a compiled function, a message of a type, a file from the disk.
settings.register_profile("here", deadline=None)
settings.load_profile("here")


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist looks for groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With `-n 2` the tests with processes of the graph go one after the other, those without beside them, by files."""
    for item in items:
        item.add_marker(pytest.mark.xdist_group("ros" if _is_ros(item) else str(item.path)))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Let the processes of the graph, which keep to the clock, go before the mathematics of the other worker."""
    if WORKER in os.environ and not _is_ros(item):
        os.setpriority(os.PRIO_PROCESS, 0, 10)


def _is_ros(item: pytest.Item) -> bool:
    return item.get_closest_marker("ros") is not None


@pytest.fixture(scope="session", autouse=True)
def _own_domain() -> Iterator[None]:
    """Keep out of the way of whatever else runs on this machine: domains 10 to 99, one for each process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(10 + os.getpid() % 90))
        yield
