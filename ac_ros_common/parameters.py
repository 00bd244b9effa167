"""Declared parameters of nodes: what one is, and those that several nodes have."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult

from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S, LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S


@dataclass(frozen=True)
class Parameter:
    """A declared parameter: its default tells the type; out-of-range values are refused by name."""

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False  # may be set while the node runs; the others only before it is configured

    def descriptor(self) -> ParameterDescriptor:
        """Return what `ros2 param describe` shows."""
        result = ParameterDescriptor(description=self.description)
        if self.choices:
            result.additional_constraints = "one of: " + ", ".join(self.choices)
        if self.low is not None and self.high is not None:
            if isinstance(self.default, int):
                result.integer_range = [IntegerRange(from_value=int(self.low), to_value=int(self.high), step=0)]
            else:
                result.floating_point_range = [FloatingPointRange(from_value=self.low, to_value=self.high, step=0.0)]
        return result

    def refuse(self, value: Any, state: str) -> str:
        """Return why the parameter cannot be set to `value` in a life-cycle state; empty when it can."""
        if not self.live and state != "unconfigured":
            return f"{self.name} cannot be set while the node is {state}: clean it up first"
        if self.choices and value not in self.choices:
            return f"{self.name} is {value!r}; allowed: {', '.join(self.choices)}"
        return ""


def checked(known: Mapping[str, Parameter], given: Iterable[Any], state: str) -> SetParametersResult:
    """Return whether parameters can be set to the values `given` in a life-cycle state, or the first reason why not."""
    for each in given:
        parameter = known.get(each.name)
        if parameter is not None and (reason := parameter.refuse(each.value, state)):
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


AUTOSTART = Parameter(
    "autostart", True, "configure and activate at once; false leaves that to whoever manages the node"
)
OPERATING_POINT = Parameter("operating_point", "med", "operating point to start at", choices=("low", "med", "high"))
PRIORITY = Parameter(
    "priority",
    0,
    "SCHED_FIFO priority of all threads while active, where the system permits it; 0: none",
    low=0,
    high=99,
)
REALTIME_CARE = Parameter(
    "realtime_care",
    False,
    "lock the memory and keep the processors from dozing while active, where the system permits it",
)
#: What every node has.
COMMON = (AUTOSTART, PRIORITY, REALTIME_CARE)
MODE = Parameter("mode", "lockstep", "what a tick waits for: loop or wall clock", choices=("lockstep", "realtime"))
SAMPLE_TIME = Parameter(
    "sample_time_s",
    DEFAULT_SAMPLE_TIME_S,
    "sample time of the loop, s",
    low=SHORTEST_SAMPLE_TIME_S,
    high=LONGEST_SAMPLE_TIME_S,
)
RUN_START = Parameter(
    "run_start_ns",
    -1,
    "stamp of the run's first tick, for a node that joins a run under way; -1: the first tick it sees",
    low=-1,
    high=2**63 - 1,
)
SENSORS = Parameter(
    "sensors", 3, "3: p_e, superheat and wall thermocouple; 2: without the thermocouple, K0 alone", low=2, high=3
)
SUPERHEAT_SENSOR = Parameter(
    "superheat_sensor",
    "direct",
    "direct: superheat is measured; derived: from an outlet thermocouple and the measured pressure",
    choices=("direct", "derived"),
)
MEMORY_FILE = Parameter(
    "memory_file",
    "",
    "realtime: file in which the node keeps what it would have to know after a crash; empty: none",
)

DESIGN = Parameter(
    "design",
    "",
    "what the designs of the run are for: one operating point (paper) or all loads (envelope); empty: what the file is",
    choices=("", "paper", "envelope"),
)

DESIGN_FILE = Parameter(
    "design_file", "", "file with the design (.npz), made by `acftc design --out` or a program of yours"
)

DESIGN_COPY = Parameter("design_copy", "", "where to leave a copy of the design in use; empty: nowhere")
