"""Node `scenario`: answers each tick of the plant with that tick's references, air side and faults."""

import json
import sys

from bringup.rest import rest_at
from bringup.ros.node_shell import NodeShell, Parameter, run_node
from bringup.topics import SCENARIO

PARAMETERS = (
    Parameter("scenario", "nominal", "name of a built-in scenario, path of a scenario file, or a scenario as JSON"),
)


class ScenarioNode(NodeShell):
    """Plays the arrays of `bringup.scenario.program`, row by row; the last row stays on."""

    def __init__(self) -> None:
        super().__init__(SCENARIO, PARAMETERS)

    def configure(self) -> None:
        """Turn the scenario into rows."""
        from bringup.scenario import check, load, program

        given = self.value("scenario")
        scenario = check(json.loads(given)) if given.lstrip().startswith("{") else load(given)
        rest = rest_at(scenario.operating_point)
        plan = program(scenario, rest["inputs"], rest["outputs"])
        # Plain floats: a row is sent number by number.
        self._rows = list(zip(plan.reference.tolist(), plan.air.tolist(), plan.faults.tolist(), strict=True))
        self._tick_ns = scenario.tick_ns
        self._start_ns: int | None = None
        self.on_tick(("plant/evaporator_pressure",), self._play)

    def _play(self, time_ns: int, _p_e: float) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns
        tick = round((time_ns - self._start_ns) / self._tick_ns)
        (p_e, superheat), (mass_flow, inlet), (f_n, f_p) = self._rows[min(tick, len(self._rows) - 1)]
        self.send(time_ns, "scenario/fault/compressor_speed", f_n)
        self.send(time_ns, "scenario/fault/evaporator_pressure", f_p)
        self.send(time_ns, "reference/evaporator_pressure", p_e)
        self.send(time_ns, "reference/superheat", superheat)
        self.send(time_ns, "scenario/air", mass_flow)
        self.send(time_ns, "scenario/air_inlet_temperature", inlet)


def main() -> int:
    """Run the node."""
    return run_node(ScenarioNode)


if __name__ == "__main__":
    sys.exit(main())
