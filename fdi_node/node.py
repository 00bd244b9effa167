"""Node `fdi`: the innovation f_e, the residuals and the decision which fault is there.

On the wall clock it goes over ticks that it missed as if the signals had moved in straight lines, and after a crash
takes up its predecessor's memory.
"""

import math
import sys

from ac_common.faults import ISOLABLE
from ac_common.signals import Command, Innovation, Measurement, topics_of
from ac_common.topics import FDI
from ac_ros_common.loop_node import MEMORY_AGE_S, NodeShell, run_node
from ac_ros_common.parameters import (
    DESIGN_COPY,
    DESIGN_FILE,
    MEMORY_FILE,
    MODE,
    RUN_START,
    SAMPLE_TIME,
)
from ac_ros_common.stuck_sensor import FROZEN_S, Frozen
from fdi_node.sequencer import Turns

PARAMETERS = (SAMPLE_TIME, MODE, RUN_START, MEMORY_FILE, DESIGN_FILE, DESIGN_COPY)
MEASURED = topics_of("measured", Measurement)
INNOVATIONS = topics_of("fdi/innovation", Innovation)
RESIDUALS = tuple(fault.residual_topic for fault in ISOLABLE)
#: How long the last measurement stands in for a missing one, s.
HOLD_S = 0.3


class FdiNode(NodeShell):
    """Shell around `FaultDetector`: one `observe` for each measurement, one `commanded` for each command."""

    def __init__(self) -> None:
        super().__init__(FDI, PARAMETERS)
        self._turns = Turns(self._observe, self._close)

    def configure(self) -> None:
        """Load the design."""
        from fdi_node import FaultDetector, FdiDesign

        self._detector = FaultDetector(self.design(FdiDesign))
        self._joins = self.run_start_ns >= 0
        self._start_ns = self.run_start_ns if self._joins else None
        self._frozen = Frozen(MEASURED)
        self._last_command: Command | None = None
        self._turns = Turns(self._observe, self._close)
        self.on_tick(
            (*MEASURED, "plant/air_inlet_temperature"),
            self._measured,
            holds_s={**dict.fromkeys(MEASURED, HOLD_S), "plant/air_inlet_temperature": math.inf},
            patience=0.3,
        )
        self.on_tick(("controller/command",), self._commanded)
        if self.is_realtime:
            self.on_tick(("actuator/setpoint",), self._commanded)

    def _measured(self, time_ns: int, *values: float) -> None:
        """Take the measurements of a tick."""
        if self.is_realtime and (topic := self._frozen.which(time_ns / 1e9, values[:3])):
            self.reject(topic, "frozen", f"{topic}: has stood still for {FROZEN_S:g} s while others moved")
            return
        if self._joins and not self._join(time_ns, *values):
            return
        self._turns.measured(time_ns, *values)

    def _commanded(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        """Take the command of a tick."""
        self._last_command = Command(compressor_speed, valve_opening)
        self._turns.commanded(time_ns, compressor_speed, valve_opening)

    def _close(self, compressor_speed: float, valve_opening: float) -> None:
        """Step the observer over the tick that was observed last."""
        self._detector.commanded(Command(compressor_speed, valve_opening))
        self.keep(self._turns.observed_ns, self._detector.memory)

    def _join(self, time_ns: int, *values: float) -> bool:
        """Begin in the middle of a run; False while there is no command yet."""
        if self._last_command is None:
            return False
        now = (Measurement(*values[:3]), values[3], self._last_command)
        memory = self.recollect(time_ns, self._detector.remember)
        if memory is None:
            self._detector.join(*now)
        else:
            self._detector.catch_up(*now, self.missed_ticks(memory["time_ns"], time_ns))
        self._joins = False
        return True

    def _catch_up(self, time_ns: int, *values: float) -> None:
        """Go over the ticks since the last one that was observed."""
        missed = self.missed_ticks(self._turns.observed_ns, time_ns)
        if missed <= 0 or self._last_command is None:
            return
        now = (Measurement(*values[:3]), values[3], self._last_command)
        if missed * self.sample_time_s < MEMORY_AGE_S:
            self._detector.catch_up(*now, missed)
        else:
            self._detector.join(*now)

    def _observe(self, time_ns: int, *values: float) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns
        if self.is_realtime and self._turns.observed_ns >= 0:
            if self._turns.awaited_ns is not None and self._last_command is not None:
                self._detector.commanded(self._last_command)
            self._catch_up(time_ns, *values)
        time_s = (time_ns - self._start_ns) / 1e9
        found = self._detector.observe(time_s, Measurement(*values[:3]), values[3])
        for topic, value in zip(INNOVATIONS, found.innovation, strict=True):
            self.send(time_ns, topic, value)
        self.send(time_ns, "fdi/status", found.status(time_s))
        for topic, value in zip(RESIDUALS, found.residual, strict=True):
            self.send(time_ns, topic, value)

    def health_values(self) -> dict[str, str]:
        """How often a measurement had to go ahead without the command of the tick before."""
        return {"missed_commands": str(self._turns.overtaken)}


def main() -> int:
    """Run the node."""
    return run_node(FdiNode)


if __name__ == "__main__":
    sys.exit(main())
