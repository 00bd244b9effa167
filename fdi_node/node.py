"""Node `fdi`: the innovation f_e, the residuals and the decision which fault is there."""

import sys

import numpy as np

from bringup.recording import StatusRow
from bringup.ros.node_shell import (
    DESIGN_COPY,
    DESIGN_FILE,
    OPERATING_POINT,
    SAMPLE_TIME,
    SUPERHEAT_SENSOR,
    NodeShell,
    Parameter,
    run_node,
)
from bringup.topics import FDI

SENSORS = Parameter("sensors", 3, "3: p_e, superheat and wall thermocouple; 2: without the thermocouple", low=2, high=3)
PARAMETERS = (OPERATING_POINT, SAMPLE_TIME, SENSORS, SUPERHEAT_SENSOR, DESIGN_FILE, DESIGN_COPY)
MEASURED = ("measured/evaporator_pressure", "measured/superheat", "measured/wall_temperature")


class FdiNode(NodeShell):
    """Shell around `FaultDetector`: one `observe` for each measurement, one `commanded` for each command."""

    def __init__(self) -> None:
        super().__init__(FDI, PARAMETERS)

    def configure(self) -> None:
        """Load the design of the operating point."""
        from fdi_node import FaultDetector, FdiDesign

        self._detector = FaultDetector(
            self.design(FdiDesign, sensors=self.value("sensors"), superheat=self.value("superheat_sensor"))
        )
        self._start_ns: int | None = None
        self._observed_ns = -1
        self._waits_for_command_of: int | None = None
        self._early: tuple[float, ...] | None = None
        self._ahead: tuple[int, float, float] | None = None
        self._overtaken = 0
        self.on_tick((*MEASURED, "plant/air_inlet_temperature"), self._measured)
        self.on_tick(("controller/command",), self._commanded)

    def _measured(self, time_ns: int, *values: float) -> None:
        """Observe; a measurement that overtook the command of the tick before waits for it."""
        if self._waits_for_command_of is None:
            self._observe(time_ns, *values)
            return
        if self._early is not None:
            # That command is lost or very late: the observer goes on with the one it has.
            self._overtaken += 1
            self._observe(*self._early)  # type: ignore[arg-type]
        self._early = (time_ns, *values)

    def _commanded(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        """Close the tick; a command that overtook its own measurement, as a replay's may, waits for it."""
        if self._waits_for_command_of is None:
            if time_ns > self._observed_ns:
                self._ahead = (time_ns, compressor_speed, valve_opening)
            return
        if time_ns < self._waits_for_command_of:
            return
        self._detector.commanded(np.array([compressor_speed, valve_opening]))
        self._waits_for_command_of = None
        if self._early is not None:
            early, self._early = self._early, None
            self._observe(*early)  # type: ignore[arg-type]

    def _observe(self, time_ns: int, *values: float) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns
        time_s = (time_ns - self._start_ns) / 1e9
        found = self._detector.observe(time_s, np.array(values[:3]), values[3])
        self._waits_for_command_of = self._observed_ns = time_ns
        p_e, superheat, wall = found.innovation.tolist()
        speed, pressure = found.residual.tolist()
        first, second = found.thresholds.tolist()
        status = StatusRow(
            time_s,
            bool(found.detected),
            found.isolated,
            float(found.size),
            float(found.onset_s),
            float(found.isolated_s),
            (first, second),
            found.also_isolated,
        )
        self.send(time_ns, "fdi/innovation/evaporator_pressure", p_e)
        self.send(time_ns, "fdi/innovation/superheat", superheat)
        self.send(time_ns, "fdi/innovation/wall_temperature", wall)
        self.send(time_ns, "fdi/status", status)
        self.send(time_ns, "fdi/residual/compressor_speed", speed)
        self.send(time_ns, "fdi/residual/evaporator_pressure", pressure)
        if self._ahead is not None:
            ahead, self._ahead = self._ahead, None
            self._commanded(*ahead)

    def health_values(self) -> dict[str, str]:
        """How often a measurement had to go ahead without the command of the tick before."""
        return {"missed_commands": str(getattr(self, "_overtaken", 0))}


def main() -> int:
    """Run the node."""
    return run_node(FdiNode)


if __name__ == "__main__":
    sys.exit(main())
