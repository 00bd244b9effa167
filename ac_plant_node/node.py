"""Node `ac_plant`: the nonlinear plant, which also beats time for the loop.

lockstep: tick k+1 begins when the command and the air side of tick k have arrived. realtime: tick k+1 begins when the
wall clock says so; a command that is late by then is counted, and the one before it stays on.
"""

import sys
import time
from typing import Any

import numpy as np

from bringup.node_shell import OPERATING_POINT, SAMPLE_TIME, NodeShell, Parameter, run_node
from bringup.topics import CLOCK, PLANT, Topic

PARAMETERS = (
    OPERATING_POINT,
    SAMPLE_TIME,
    Parameter(
        "mode", "lockstep", "what a tick waits for: the loop or the wall clock", choices=("lockstep", "realtime")
    ),
    Parameter("ticks", 0, "stop after this many ticks; 0: never", low=0, high=2**31 - 1),
)


class PlantNode(NodeShell):
    """Shell around `Plant`."""

    def __init__(self) -> None:
        super().__init__(PLANT, PARAMETERS)

    def configure(self) -> None:
        """Put the plant at rest at its operating point."""
        from ac_plant_node import Plant, operating_point

        point = self.value("operating_point")
        rest = operating_point(point)
        self._plant = Plant.at(point)
        self._inputs = np.array(rest.inputs, dtype=np.float64)
        self._outputs = np.array(rest.outputs, dtype=np.float64)
        self._sample_time_s: float = self.value("sample_time_s")
        self._tick_ns = round(self._sample_time_s * 1e9)
        self._last_tick: int = self.value("ticks") - 1
        self._tick = 0
        self._started_s = time.monotonic()
        self._wall_s = 0.0
        self._finished = False
        self.add_output(Topic("clock", CLOCK, PLANT), "/clock")
        self.on_tick(
            ("actuator/command", "scenario/air", "scenario/air_inlet_temperature"),
            self._commanded,
        )

    def started(self) -> None:
        """Publish the first tick."""
        self._started_s = time.monotonic()
        self.create_timer_once(self._publish)

    def _publish(self) -> None:
        time_ns = self._tick * self._tick_ns
        p_e, superheat, wall, p_c = self._outputs.tolist()
        self.send(time_ns, "clock")
        self.send(time_ns, "plant/evaporator_pressure", p_e)
        self.send(time_ns, "plant/superheat", superheat)
        self.send(time_ns, "plant/wall_temperature", wall)
        self.send(time_ns, "plant/air_inlet_temperature", float(self._inputs[3]))
        self.send(time_ns, "plant/condenser_pressure", p_c)

    def _commanded(self, time_ns: int, *values: float) -> None:
        """Advance over tick k, whose inputs are complete, and publish tick k+1."""
        if time_ns != self._tick * self._tick_ns or self._finished:
            return
        self._inputs[:] = values
        try:
            self._outputs = self._plant.step(self._inputs, self._sample_time_s)
        except ValueError as problem:
            msg = f"the plant stopped at {time_ns / 1e9:.1f} s: {problem}"
            raise ValueError(msg) from problem
        if self._tick == self._last_tick:
            self._finished = True
            self._wall_s = time.monotonic() - self._started_s
            self.create_timer_once(self.report_health)
            return
        self._tick += 1
        self._publish()

    def health_values(self) -> dict[str, Any]:
        """Where the run is."""
        return {
            "tick": str(getattr(self, "_tick", 0)),
            "finished": "true" if getattr(self, "_finished", False) else "false",
            "wall_seconds": repr(getattr(self, "_wall_s", 0.0)),
            "missed_ticks": "0",
        }


def main() -> int:
    """Run the node."""
    return run_node(PlantNode)


if __name__ == "__main__":
    sys.exit(main())
