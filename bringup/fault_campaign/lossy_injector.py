"""Node `fault_injector` whose messages suffer as a campaign's plan says.

``python -m bringup.fault_campaign.lossy_injector PLAN.json --ros-args ...``: what goes from the injector to fdi,
controller and plant is lost, late, doubled or spoiled on its way out; the recorder sees what the others see.
"""

import heapq
import json
import sys
import threading
import time
from itertools import count
from pathlib import Path
from typing import Any

from ac_common.wire import NANOSECONDS
from ac_experiments.campaign.message_faults import with_faults
from ac_experiments.campaign.plan import MessageFault
from ac_ros_common.loop_node import run_node
from fault_injector_node.node import MEASURED, InjectorNode

LOSSY_TOPICS = (*MEASURED, "actuator/command")


class LossyInjector(InjectorNode):
    """The injector with a bad line."""

    def __init__(self, seed: int, faults: tuple[MessageFault, ...]) -> None:
        super().__init__()
        self._seed, self._faults = seed, faults
        self._first_ns: int | None = None
        self._late: list[tuple[float, int, int, str, tuple[float, ...]]] = []
        self._number = count()
        self._is_late = threading.Condition()
        threading.Thread(target=self._deliver, daemon=True).start()

    def send(self, time_ns: int, topic: str, *values: Any) -> None:
        """Publish the values of one topic, or what becomes of them."""
        if topic not in LOSSY_TOPICS:
            super().send(time_ns, topic, *values)
            return
        if self._first_ns is None:
            given = self.value("run_start_ns")
            self._first_ns = given if given >= 0 else time_ns
        time_s = (time_ns - self._first_ns) / NANOSECONDS
        for delivery in with_faults(self._faults, self._seed, topic, time_s, values):
            if delivery.delay_s <= 0.0:
                super().send(time_ns, topic, *delivery.values)
                continue
            with self._is_late:
                due_s = time.monotonic() + delivery.delay_s
                heapq.heappush(self._late, (due_s, next(self._number), time_ns, topic, delivery.values))
                self._is_late.notify()

    def _deliver(self) -> None:
        """Send late messages when they are due."""
        while True:
            with self._is_late:
                wait_s = self._late[0][0] - time.monotonic() if self._late else None
                if wait_s is None or wait_s > 0.0:
                    self._is_late.wait(wait_s)
                    continue
                _, _, time_ns, topic, values = heapq.heappop(self._late)
            if self.running:
                super().send(time_ns, topic, *values)


def main() -> int:
    """Run the node with the plan in the file that the first argument names."""
    plan = json.loads(Path(sys.argv.pop(1)).read_text(encoding="utf-8"))
    faults = tuple([MessageFault(**fault) for fault in plan["messages"]])
    return run_node(lambda: LossyInjector(plan["seed"], faults))


if __name__ == "__main__":
    sys.exit(main())
