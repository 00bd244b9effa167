"""What all tests share: settings of the mathematics and of property-based tests, and a ROS domain of their own."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

# Matrices here are small: several BLAS threads make the linear algebra ten times slower. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from tests.domains import OWN

if TYPE_CHECKING:
    from playwright.sync_api import Browser

#: What pytest-xdist calls a process of its own.
WORKER = "PYTEST_XDIST_WORKER"
#: Markers of the tests that go one after the other. Those on the clock first: who steps back stays there.
GRAPHS = ("clock", "ros")

#: Files whose tests together take more than some seconds: of these a developer runs the ones of what has changed.
LONG = {
    "accommodation", "authority", "bad_inputs", "blas_threads", "cabin", "cache", "car_in_the_box", "car_runs",
    "car_table", "cli", "cli_study", "colcon", "comparison_page", "designs", "figures", "foreign_bags", "hinfsyn",
    "jumping_inputs", "loop_stability", "mending", "messages", "new_fault", "observer_anywhere", "own_plant",
    "paper_controller", "protection", "report", "report_page", "resources", "scales", "simulate", "step_response",
    "study_engine", "study_results", "study_scaling", "study_statistics", "thresholds", "zones",
}  # fmt: skip

# The first call of much takes its time: a compiled function, a message of a type, a file from the disk.
settings.register_profile("here", deadline=None)
settings.load_profile("here")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave files without a quick test unread under `-m quick`: what they import takes its time, too."""
    return True if config.option.markexpr == "quick" and _takes_long(collection_path) else None


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist looks for groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With `-n 2` graphs on the wall clock go one after the other, all other graphs likewise, the rest by files.

    `quick` are all tests that start no graph and take no time, so that `pytest -m quick` does not, either.
    """
    for item in items:
        if not any(_is(item, kind) for kind in (*GRAPHS, "slow")) and not _takes_long(item.path):
            item.add_marker("quick")
    if WORKER in os.environ:
        items.sort(key=lambda item: (not _is(item, "clock"), not _is(item, "ros")))
        for item in items:
            group = next((kind for kind in GRAPHS if _is(item, kind)), item.path.relative_to(item.config.rootpath))
            item.add_marker(pytest.mark.xdist_group(str(group)))


def pytest_collection_finish(session: pytest.Session) -> None:
    """See that pytest-xdist has found the groups: with another pytest it silently did not."""
    if WORKER in os.environ and not all("@" in item.nodeid for item in session.items):
        raise pytest.UsageError("pytest-xdist does not put together the tests that belong together")


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Let processes that keep to the clock go before whatever the other worker does."""
    if WORKER in os.environ and not _is(item, "clock"):
        os.setpriority(os.PRIO_PROCESS, 0, 10)


def _takes_long(file: Path) -> bool:
    return file.stem.removeprefix("test_") in LONG


def _is(item: pytest.Item, kind: str) -> bool:
    return item.get_closest_marker(kind) is not None


@pytest.fixture(scope="module")
def browser() -> "Iterator[Browser]":
    """A browser for each file of tests that wants one."""
    from tests.live_browser import started_browser

    with started_browser() as browser:
        yield browser


@pytest.fixture(scope="session", autouse=True)
def _own_domain() -> Iterator[None]:
    """Keep out of the way of whatever else runs on this machine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(OWN))
        yield
