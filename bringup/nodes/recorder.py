"""Node `recorder`: every message of the loop, as it came over the wire, into a bag."""

from ac_ros_common.installation import begin_node

if __name__ == "__main__":
    begin_node()

import json
import sys
import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message

from ac_common.design_file import ATTACHMENT, DESIGNED
from ac_common.health import PlantReport, RecorderReport
from ac_common.topics import BY_NAME, CAR, OCCASIONAL, PLANT, RECORDER, TICKED, TOPICS
from ac_common.wire import stamp_ns
from ac_experiments.bags.recorder import BagWriter, recorded_topics
from ac_ros_common.inputs import Arrival, Subscriptions
from ac_ros_common.loop_node import IDLE_S, LoopNode, run_node
from ac_ros_common.parameters import MODE, Parameter
from ac_ros_common.qos import PLAIN_QOS

#: Far below what the middleware keeps for a slow reader, and below the bag's flush period.
TAKE_PERIOD_S = 0.02

#: How long after the plant's last tick messages may still come in when the wall clock ends the run, s.
REALTIME_PATIENCE_S = 0.5

PARAMETERS = (
    Parameter("folder", "bag", "folder of the bag; must not hold one yet"),
    Parameter("append", False, "go on in a further file of a bag that is there already"),
    Parameter("run", "{}", "what is being run, as JSON; stored in the bag"),
    Parameter(
        "ticks", 0, "complete after this many messages of each loop topic; 0: when told to", low=0, high=2**31 - 1
    ),
    Parameter("designs", "", "folder with copies of the designs in use, to be stored in the bag; empty: none"),
    MODE,
)


class RecorderNode(LoopNode):
    """Shell around `BagWriter`: takes serialised messages and never looks into them, but for the health reports."""

    def __init__(self) -> None:
        super().__init__(RECORDER, PARAMETERS)
        self._bag: BagWriter | None = None
        self._finished_s: float | None = None
        self._last_ns = 0
        self._complete = False

    def configure(self) -> None:
        """Open the bag and subscribe to everything."""
        self._lockstep: bool = self.value("mode") == "lockstep"
        self._ticks: int = self.value("ticks")
        namespace = self.get_namespace().rstrip("/")
        topics = recorded_topics(self._lockstep, namespace)
        self._loop_topics = len(TOPICS)
        self._ticked = [TOPICS.index(topic) for topic in TICKED]
        self._last_topic = TOPICS.index(BY_NAME["actuator/command"])  # of a tick: when it is there, all were
        self._health_topic = len(TOPICS) + len(OCCASIONAL)
        self._names = [topic.name for topic in topics]
        self._last_ns = 0
        run = json.loads(self.value("run"))
        if run.get("scenario", {}).get("car") is not None:
            self._ticked += [self._loop_topics + OCCASIONAL.index(topic) for topic in CAR]
        self._bag = BagWriter(Path(self.value("folder")), topics, run, append=self.value("append"))
        self._raw = Subscriptions(self.context, self._write)
        for topic in topics:
            self._raw.add(self.subscribe(topic.type, topic.name, PLAIN_QOS))

    @property
    def time_ns(self) -> int:
        """Time on this node's clock, ns: in lockstep that of the newest message."""
        return self._last_ns if self.value("mode") == "lockstep" else super().time_ns

    def work(self, executor: SingleThreadedExecutor) -> None:
        """Take what has piled up now and then: waking for every single message would cost more than writing it."""
        if not self.running:
            executor.spin_once(timeout_sec=IDLE_S)
            return
        executor.spin_once(timeout_sec=TAKE_PERIOD_S)
        self._raw.take()
        if self._bag is not None:
            self._bag.flush_if_due()
        if self._finished_s is not None and not self._complete and self._is_complete(self._finished_s):
            self._complete = True
            self.report_health()

    def _is_complete(self, finished_s: float) -> bool:
        """Whether nothing of the run is missing; on the wall clock a late tick may stay away for good."""
        return not self.missing() or (not self._lockstep and time.monotonic() - finished_s > REALTIME_PATIENCE_S)

    def _write(self, messages: list[Arrival]) -> bool:
        bag = self._bag
        if bag is None:
            return False
        now_ns = 0 if self._lockstep else time.time_ns()
        for number, data, _ in messages:
            if number == self._health_topic:
                self._look_at_health(data)
                bag.write(number, data, now_ns or self._last_ns, now_ns or self._last_ns)
                continue
            stamp = stamp_ns(data)
            if number < self._loop_topics and stamp > self._last_ns:
                self._last_ns = stamp
            bag.write(number, data, now_ns or stamp, stamp)
        was_idle, self.health.ticks = self.health.ticks == 0, bag.counts[0]
        if was_idle and self.health.ticks:
            self.soon(self.report_health)  # it is in service
        if self._finished_s is None and not self._lockstep and 0 < self._ticks <= bag.counts[self._last_topic]:
            self._finished_s = time.monotonic()  # for a plant that has nothing to say on /diagnostics
        return True

    def _look_at_health(self, data: bytes) -> None:
        """See from the plant's health report whether the run is over."""
        for status in deserialize_message(data, DiagnosticArray).status:
            if self._finished_s is None and status.name.endswith(f"/{PLANT}"):
                said = PlantReport.read({item.key: item.value for item in status.values})
                self._finished_s = time.monotonic() if said.finished else None

    def missing(self) -> str:
        """Return which messages of the run are not in the bag: empty when every one is."""
        if self._bag is None or not self._ticks:
            return ""
        wanted = [*self._ticked, *([self._health_topic + 1] if self._lockstep else [])]
        gaps = [
            f"{self._names[n]} {self._bag.counts[n]} of {self._ticks}"
            for n in wanted
            if self._bag.counts[n] != self._ticks
        ]
        return ", ".join(gaps)

    def stopped(self) -> None:
        """Make the bag complete."""
        if self._bag is None:
            return
        if rclpy.ok():
            self._raw.take()  # what was still on its way
        bag, self._bag = self._bag, None
        if self._complete:
            self._attach_designs(bag)
        bag.close()

    def _attach_designs(self, bag: BagWriter) -> None:
        """Store the designs that were used: whoever replays the bag elsewhere must not depend on a synthesis there."""
        for node in DESIGNED:
            file = Path(self.value("designs")) / f"{node}.npz"
            if self.value("designs") and file.exists():
                bag.attach(ATTACHMENT.format(node), file.read_bytes())

    def node_health(self) -> RecorderReport:
        """Return whether the bag holds the whole run."""
        return RecorderReport(self._complete, self.missing() if self._finished_s is not None else "")


def main() -> int:
    """Run the node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    sys.exit(main())
