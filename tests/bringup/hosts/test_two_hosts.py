"""The graph over two hosts: two network namespaces, 5 ms and 1 % loss on the wire, clocks apart by 0.3 s."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ac_common.topics import truth_of
from ac_experiments.bags.reader import health_reports, read_bag, read_raw
from tests.domains import OWN

pytestmark = [pytest.mark.ros, pytest.mark.clock]

HERE = Path(__file__).parent
DELAY_S, LOSS, APART_S = 0.005, 0.01, 0.3
#: The plant on a host whose clock is ahead.
AHEAD = f"""
import sys, time
right = time.time_ns
time.time_ns = lambda: right() + round({APART_S} * 1e9)
from ac_plant_node.node import main
sys.argv[0] = "ac_plant_node"
sys.exit(main())
"""


@pytest.fixture
def hosts() -> Iterator[tuple[str, str]]:
    """Two namespaces with a wire between them."""
    names = f"acftc{os.getpid()}a", f"acftc{os.getpid()}b"
    command = [sys.executable, str(HERE / "wire.py"), *names, str(DELAY_S), str(LOSS), "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as wire:
        assert wire.stdout is not None
        if wire.stdout.readline() != "ready\n":
            pytest.skip(f"no network namespaces can be made here: {wire.communicate()[1].strip()[-200:]}")
        yield names
        wire.terminate()
        wire.wait(10)


def on(host: str, *command: str) -> "subprocess.Popen[str]":
    """A process on a host, told nothing but that the loop is on more than one."""
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": str(OWN)}
    environment.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
    return subprocess.Popen(
        ["ip", "netns", "exec", host, *command], stderr=subprocess.PIPE, text=True, env=environment, process_group=0
    )


def test_plant_on_another_host_closes_the_loop(hosts: tuple[str, str], tmp_path: Path) -> None:
    here, there = hosts
    options = ["--mode", "realtime", "--without", "ac_plant", "--set", "duration_s=20", "--set", "faults.0.onset_s=5"]
    run = on(here, sys.executable, "-m", "bringup.cli", "run", "actuator_fault", *options, "--no-report", "--out",
             str(tmp_path))  # fmt: skip
    assert run.stderr is not None
    told = next(line for line in run.stderr if "ours would be" in line)
    arguments = shlex.split(re.split(r"-m ac_plant_node ", told)[1])
    plant = on(there, sys.executable, "-c", AHEAD, *arguments)
    try:
        _, said = run.communicate(timeout=120)
    finally:
        plant.terminate()
        plant.wait(20)
        run.kill()
    assert run.returncode == 0, said
    recording = read_bag(tmp_path / "bag")
    assert len(recording.time_s) == 200
    series = recording.series
    # Reliable delivery makes good what the wire loses; late is what comes a heartbeat later, or on a busy machine.
    for topic in ("plant/superheat", "controller/command:compressor", "actuator/command:compressor"):
        assert np.mean(np.isnan(series[topic])) < 0.5, topic
    last = dict(health_reports(read_raw(tmp_path / "bag")))
    assert float(last["ac_plant"]["command_latency_p50_ms"]) > 2e3 * DELAY_S  # there and back
    # What is concluded from readings that come late is the machine's matter. That the loop is closed is not: what
    # reaches the actuators is what the controller on the other host has sent, with the fault.
    sent, acting = series["controller/command:compressor"], series["actuator/command:compressor"]
    off = np.abs((acting - series[truth_of("compressor_speed")])[:, None] - sent[None, :])
    assert np.mean(np.any(off < 1e-9, axis=1)) > 0.5  # a tick whose messages were late agrees with none
    assert np.nanmax(sent) - np.nanmin(sent) > 1.0
