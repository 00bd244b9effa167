"""Node `fdi`: the innovation f_e, the residuals and the decision which fault is there.

On the wall clock it goes over ticks that it missed as if the signals had moved in straight lines, and after a crash
it takes up its predecessor's state.
"""

import math
import sys

from ac_common.faults import ISOLABLE
from ac_common.health import FdiReport
from ac_common.signals import Command, Innovation, topics_of
from ac_common.topics import FDI
from ac_ros_common.checkpoint import AGE_S
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import (
    DESIGN,
    DESIGN_COPY,
    DESIGN_FILE,
    MEMORY_FILE,
    MODE,
    RUN_START,
    SAMPLE_TIME,
)
from ac_ros_common.sequencer import Sequencer
from ac_ros_common.stuck_sensor import STUCK_S, StuckSensor
from fdi_node.making import KINDS, make_detector

PARAMETERS = (SAMPLE_TIME, MODE, RUN_START, MEMORY_FILE, DESIGN, DESIGN_FILE, DESIGN_COPY)
MEASURED = topics_of("measured", Innovation)
INNOVATIONS = topics_of("fdi/innovation", Innovation)
RESIDUALS = tuple(fault.residual_topic for fault in ISOLABLE)
#: How long the last measurement stands in for a missing one, s.
HOLD_S = 0.3


class FdiNode(LoopNode):
    """Shell around a detector: one `observe` for each measurement, one `commanded` for each command."""

    def __init__(self) -> None:
        super().__init__(FDI, PARAMETERS)
        self._sequencer = Sequencer(self._observe, self._close)

    def configure(self) -> None:
        """Load the design."""
        design = self.design(KINDS)
        self._detector, kind = make_detector(design)
        self._readings, self._inlets = kind.readings, kind.inlets
        self._joins = self.run_start_ns >= 0
        self._start_ns = self.run_start_ns if self._joins else None
        self._stuck = StuckSensor(MEASURED)
        self._last_command: Command | None = None
        self._sequencer = Sequencer(self._observe, self._close)
        topics = kind.topics(design)
        self.on_tick(
            topics,
            self._measured,
            holds_s={topic: HOLD_S if i < kind.readings else math.inf for i, topic in enumerate(topics)},
            patience=0.3,
        )
        self.on_tick(("controller/command",), self._commanded)
        if self.is_realtime:
            self.on_tick(("actuator/setpoint",), self._commanded)

    def _measured(self, time_ns: int, *values: float) -> None:
        """Take the measurements of a tick."""
        if self.is_realtime and (topic := self._stuck.which(time_ns / 1e9, values[:3])):
            self.health.reject(topic, "frozen", f"{topic}: has stood still for {STUCK_S:g} s while others moved")
            return
        if self._joins:
            if self._last_command is None:
                return
            saved_ns = self.checkpoint.load(time_ns, self._detector)
            self._warm_restart(saved_ns, time_ns, *values)
            self._joins = False
        self._sequencer.measured(time_ns, *values)

    def _commanded(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        """Take the command of a tick."""
        self._last_command = Command(compressor_speed, valve_opening)
        self._sequencer.commanded(time_ns, compressor_speed, valve_opening)

    def _close(self, compressor_speed: float, valve_opening: float) -> None:
        """Step the observer over the tick that was observed last."""
        self._detector.commanded(Command(compressor_speed, valve_opening))
        self.checkpoint.save(self._sequencer.observed_ns, self._detector)

    def _warm_restart(self, since_ns: int | None, time_ns: int, *values: float) -> None:
        """Go over the ticks since the last one that the detector knows; None: it knows none."""
        if self._last_command is None:
            return
        missed = None if since_ns is None else self.missed_ticks(since_ns, time_ns)
        if missed is not None and missed * self.sample_time_s >= AGE_S:
            missed = None  # straight lines over so long a time mean nothing
        if missed is None or missed > 0:
            readings, others = values[: self._readings], values[self._readings :]
            inlets, air_flow = others[: self._inlets], others[self._inlets :]
            self._detector.warm_restart(readings, *inlets, self._last_command, missed, *air_flow)

    def _observe(self, time_ns: int, *values: float) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns
        if self.is_realtime and self._sequencer.observed_ns >= 0:
            if self._sequencer.awaited_ns is not None and self._last_command is not None:
                self._detector.commanded(self._last_command)
            self._warm_restart(self._sequencer.observed_ns, time_ns, *values)
        time_s = (time_ns - self._start_ns) / 1e9
        found = self._detector.observe(time_s, values[: self._readings], *values[self._readings :])
        for topic, value in zip(INNOVATIONS, found.innovation, strict=True):
            self.send(time_ns, topic, value)
        self.send(time_ns, "fdi/status", found.status(time_s))
        for topic, value in zip(RESIDUALS, found.residual, strict=True):
            self.send(time_ns, topic, value)

    def node_health(self) -> FdiReport:
        """Return how often a measurement had to go ahead without the command of the tick before."""
        return FdiReport(self._sequencer.overtaken)


def main() -> int:
    """Run the node."""
    return run_node(FdiNode)


if __name__ == "__main__":
    sys.exit(main())
