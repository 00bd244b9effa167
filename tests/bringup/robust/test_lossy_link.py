"""Lossy links between all nodes of the loop: 20 % of the messages lost, the others late by up to 50 ms.

Each node has its relay inside: what it would send is lost or sent later, by chance. The plant's deadline is that of its
ticks, so what it sends is lost, but not late.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

from ac_experiments.bags.reader import health_reports, read_bag, read_raw
from ac_experiments.scenario import check
from bringup.launch.launch import run_graph
from bringup.launch.user_nodes import user_nodes

pytestmark = [pytest.mark.ros, pytest.mark.clock]

SCENARIO = {
    "name": "lossy",
    "design": "paper",
    "duration_s": 22.0,
    "references": {"evaporator_pressure_kpa": [{"at_s": 2, "to": 2.0}]},
    "faults": [{"kind": "compressor_speed", "size_rpm": 40, "onset_s": 8}],
    "noise": {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02, "seed": 3},
}
LOSSY = """
import heapq, random, sys, time
from importlib import import_module
from ac_ros_common.loop_node import LoopNode, run_node
from ac_common.topics import TOPICS, RECORDER
module = import_module(sys.argv[1])
(node,) = [k for k in vars(module).values() if isinstance(k, type) and issubclass(k, LoopNode) and k is not LoopNode]
LINKS = {topic.name for topic in TOPICS if set(topic.subscribers) - {RECORDER}}
class Lossy(node):
    chance, waiting = random.Random(5), []
    def send(self, time_ns, topic, *values):
        if topic not in LINKS:
            super().send(time_ns, topic, *values)
        elif self.chance.random() < 0.2:
            return
        elif module.__name__ == "ac_plant_node.node":
            super().send(time_ns, topic, *values)
        else:
            due = time.monotonic() + 0.05 * self.chance.random()
            heapq.heappush(self.waiting, (due, len(self.waiting), topic, time_ns, values))
            self.loop.deadline_s = self.waiting[0][0]
    def on_deadline(self):
        if module.__name__ == "ac_plant_node.node":
            return super().on_deadline()
        while self.waiting and self.waiting[0][0] <= time.monotonic() + 1e-4:
            _, _, topic, time_ns, values = heapq.heappop(self.waiting)
            super().send(time_ns, topic, *values)
        self.loop.deadline_s = self.waiting[0][0] if self.waiting else float("inf")
sys.exit(run_node(Lossy))
"""
MODULES = {
    "ac_plant": "ac_plant_node.node",
    "fault_injector": "fault_injector_node.node",
    "fdi": "fdi_node.node",
    "compensator": "gimc_controller_node.compensator_node",
    "gimc_controller": "gimc_controller_node.node",
}


def test_loop_stays_stable_on_a_lossy_link_and_says_what_was_missing(tmp_path: Path) -> None:
    relay = tmp_path / "lossy.py"
    relay.write_text(LOSSY)
    own = user_nodes([f"{name}={sys.executable} {relay} {module}" for name, module in MODULES.items()])
    run = run_graph(check(SCENARIO), tmp_path / "out", mode="realtime", care=True, user=own)
    recording = read_bag(run.bag)
    series = recording.series
    lost = {
        topic: float(np.mean(np.isnan(series[topic])))
        for topic in ("measured/superheat", "controller/command:compressor", "actuator/command:compressor")
    }
    # A command in every tick, of which the link loses its share; the injector passes on what has come, in both ways.
    assert 0.1 < lost["controller/command:compressor"] < 0.35, lost
    assert 0.2 < lost["measured/superheat"] < 0.55, lost
    assert lost["actuator/command:compressor"] > lost["controller/command:compressor"]
    error_pa = series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"]
    assert np.nanmax(np.abs(error_pa[50:])) < 3e3
    assert np.nanmean(np.abs(error_pa[-50:])) < 1e3
    assert np.nanmin(series["plant/superheat"]) > 15.0
    last = dict(health_reports(read_raw(run.bag)))
    assert int(last["gimc_controller"]["missing/measured/superheat"]) > 20
    assert int(last["fdi"]["missing/measured/wall_temperature"]) > 20
    assert int(last["compensator"]["missing/fdi/status"]) > 20
    isolated = [row.isolated for row in recording.status]
    assert "compressor_speed" in isolated[80:]
    assert "evaporator_pressure" not in isolated
