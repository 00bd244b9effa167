"""Node `fault_injector`: sits between plant and loop in both directions."""

import sys

import numpy as np

from bringup.node_shell import NodeShell, Parameter, run_node
from bringup.topics import INJECTOR
from fault_injector_node.injector import FaultInjector

PARAMETERS = (
    Parameter("noise_std", [0.0, 0.0, 0.0], "standard deviation of the noise on p_e (Pa), superheat (K), T_w (K)"),
    Parameter("seed", 0, "seed of the noise", low=0, high=2**31 - 1),
)
#: Ticks whose command may still be on its way.
MOST_OPEN_TICKS = 100


class InjectorNode(NodeShell):
    """Shell around `FaultInjector`; publishes the truth about the faults for whoever evaluates the run."""

    def __init__(self) -> None:
        super().__init__(INJECTOR, PARAMETERS)

    def configure(self) -> None:
        """Make the injector."""
        self._injector = FaultInjector(self.value("noise_std"), self.value("seed"))
        self._f_n: dict[int, float] = {}  # of ticks whose command has not come yet
        self._measured_ns = -1
        self._early: tuple[int, float, float] | None = None  # a command that overtook its tick's measurement
        self.on_tick(
            (
                "plant/evaporator_pressure",
                "plant/superheat",
                "plant/wall_temperature",
                "scenario/fault/compressor_speed",
                "scenario/fault/evaporator_pressure",
            ),
            self._measure,
        )
        self.on_tick(("controller/command",), self._actuate)

    def _measure(self, time_ns: int, p_e: float, superheat: float, wall: float, f_n: float, f_p: float) -> None:
        self._f_n[time_ns] = f_n
        while len(self._f_n) > MOST_OPEN_TICKS:
            del self._f_n[min(self._f_n)]
        measured = self._injector.measure(np.array([p_e, superheat, wall]), f_p).tolist()
        self.send(time_ns, "measured/evaporator_pressure", measured[0])
        self.send(time_ns, "measured/superheat", measured[1])
        self.send(time_ns, "measured/wall_temperature", measured[2])
        self.send(time_ns, "fault/compressor_speed", f_n)
        self.send(time_ns, "fault/evaporator_pressure", f_p)
        self._measured_ns = time_ns
        if self._early is not None and self._early[0] <= time_ns:
            early, self._early = self._early, None
            self._actuate(*early)

    def _actuate(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        if time_ns > self._measured_ns:
            self._early = (time_ns, compressor_speed, valve_opening)
            return
        f_n = self._f_n.pop(time_ns, 0.0)
        actuator = self._injector.actuate(np.array([compressor_speed, valve_opening]), f_n)
        self.send(time_ns, "actuator/command", *actuator.tolist())


def main() -> int:
    """Run the node."""
    return run_node(InjectorNode)


if __name__ == "__main__":
    sys.exit(main())
