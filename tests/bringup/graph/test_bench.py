"""The benchmark's yardsticks run, and its verdicts follow from its figures."""

import json
import subprocess
import sys

import pytest

from bringup.benchmarks.figure import Figure
from bringup.benchmarks.figures import as_dicts, bare_chain


def test_verdicts() -> None:
    figures = [
        Figure("speed", "x", 14.0, 13.0, at_least=True),
        Figure("speed", "x", 12.0, 13.0, at_least=True),
        Figure("memory", "MB", 119.0, 120.0),
        Figure("memory", "MB", 121.0, 120.0),
        Figure("for information", "", 1.0),
    ]
    assert [figure.passed for figure in figures] == [True, False, True, False, None]
    assert json.loads(json.dumps(as_dicts(figures)))[1]["passed"] is False


@pytest.mark.ros
def test_bare_chain_moves_every_tick() -> None:
    figures = bare_chain(50)
    assert figures["ticks_per_second"] > 0.0
    assert 0.0 < figures["latency_p50_ms"] <= figures["latency_p99_ms"] <= figures["latency_max_ms"]


def test_host_noise_is_measured() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "bringup.benchmarks.host_noise", "0.2"], capture_output=True, text=True, timeout=30
    )
    figures = json.loads(said.stdout)
    assert 0.0 <= figures["p99_ms"] <= figures["max_ms"]
