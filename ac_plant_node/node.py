"""Node `ac_plant`: the nonlinear plant, which also provides the clock of the loop.

lockstep: tick k+1 begins when the command, the air side and, where it waits for them, the components' faults of tick k
have arrived; stamps count from 0 and are published on `/clock`. realtime: tick k+1 begins by the wall clock, whose time
the stamps carry. A command that has not come by then counts as a missed tick, and the previous one is held (zero-order
hold) for at most `command_hold_s`; then the actuators go to the operating point's command. A plant that was stopped
steps over the missed ticks without publishing them.
"""

import math
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import COMPONENT_KINDS
from ac_common.health import PlantReport
from ac_common.safe_command import COMMAND_HOLD_S, CommandHold
from ac_common.signals import Cabin, Performance
from ac_common.topics import AIR_SIDE, CLOCK, PLANT, Topic
from ac_plant_node.rest import rest_at
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import MODE, OPERATING_POINT, SAMPLE_TIME, Parameter
from ac_ros_common.realtime import Latencies

#: Fields of `ac_plant_node.cabin.CabinState` that are parameters: default, meaning, range.
CABIN = (
    ("air_c", 30.0, "air of the cabin, degC,", -50.0, 150.0),
    ("interior_c", 30.0, "interior of the cabin, degC,", -50.0, 150.0),
    ("humidity_ratio", 0.01, "humidity ratio of its air", 0.0, 1.0),
)
PARAMETERS = (
    OPERATING_POINT,
    SAMPLE_TIME,
    MODE,
    Parameter(
        "command_hold_s",
        COMMAND_HOLD_S,
        "realtime: how long the last command stays on when none comes, before the operating point's does, s",
        0.0,
        60.0,
    ),
    Parameter(
        "component_faults",
        False,
        "lockstep: whether each tick waits for `component/faults`, not only takes them",
    ),
    Parameter("in_car", False, "whether the plant is in a car, whose drive `scenario/car` plays"),
    *(
        Parameter(f"cabin.{name}", value, f"in a car: {text} at the start", low, high)
        for name, value, text, low, high in CABIN
    ),
    Parameter("ticks", 0, "stop after this many ticks; 0: never", low=0, high=2**31 - 1),
)
NO_FAULTS = (0.0,) * len(COMPONENT_KINDS)
#: A command that is later than this is not counted in the latencies any more.
MOST_LATE_TICKS = 1000
#: A wake-up that is late by more than this share of the sample time is counted.
LATE_SHARE = 0.5
#: So many of the missed ticks, and of the late commands, are told one by one in a health report.
MOST_TOLD = 200
#: What a model of somebody else's has of what ours tells for evaluation.
_UNTOLD = Performance(*[math.nan] * len(Performance._fields))
_UNTOLD_CABIN = Cabin(*[math.nan] * len(Cabin._fields))
#: What is played to a car beside its air.
DRIVE = "scenario/car"


class Model(Protocol):
    """What the node advances: `ac_plant_node.Plant`, or a model of your own."""

    def step(self, inputs: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
        """Return the outputs after `duration_s` with `inputs` held.

        Parameters
        ----------
        inputs : ndarray, shape (n,)
            As many as `PlantNode.make_model` gives, 4 to 7: compressor speed [rad/s], valve opening [0..1], air flow
            [kg/s], air inlet temperature [degC]; air flow at the condenser [kg/s], its inlet temperature [degC],
            relative humidity at the evaporator's inlet [0..1]. In a car 12, as `ac_plant_node.car.Car` takes them.
        duration_s : float

        Returns
        -------
        ndarray, shape (4,)
            Evaporator pressure [Pa], superheat [K], wall temperature [degC], condenser pressure [Pa].
        """


@runtime_checkable
class FaultyModel(Model, Protocol):
    """A model whose components can be faulty."""

    def hold_faults(self, sizes: Sequence[float]) -> None:
        """Have the faults of `ac_plant_node.inputs.FAULTS` from now on, SI."""


class PlantNode(LoopNode):
    """ROS node of the plant, or of another `Model`."""

    def __init__(self) -> None:
        super().__init__(PLANT, PARAMETERS)
        self._plant: Model | None = None
        self._tick = 0
        self._finished = False
        self._missed = 0
        self._latencies = Latencies()
        self._missed_at: deque[int] = deque(maxlen=MOST_TOLD)
        self._late_commands: deque[tuple[int, float]] = deque(maxlen=MOST_TOLD)  # tick, s after its end
        self._late_wakeups = 0
        self._published_s: dict[int, float] = {}  # of ticks whose command has not come yet
        self._wall_s = 0.0
        self._first_ns = 0
        self._epoch_s = math.nan

    def make_model(self) -> tuple[Model, NDArray[np.float64], NDArray[np.float64]]:
        """Return the plant at rest, with its inputs and outputs there; override it for another model."""
        from ac_plant_node import OperatingPoint, Plant

        point = self.value("operating_point")
        rest = OperatingPoint(point, **rest_at(point))  # type: ignore[arg-type]
        if self.value("in_car"):
            return self._make_car(rest.inputs)
        # Compiled code is loaded with the first step: here, not in the first tick.
        Plant.at(rest).step(rest.inputs, self.value("sample_time_s"))
        return Plant.at(rest), rest.inputs, rest.outputs

    def _make_car(self, inputs: NDArray[np.float64]) -> tuple[Model, NDArray[np.float64], NDArray[np.float64]]:
        """Return the car, with the plant's inputs at rest and those of a car that stands, and the plant's outputs."""
        from ac_plant_node.cabin import CabinState
        from ac_plant_node.car import N_CAR, Car

        cabin = CabinState(**{name: self.value(f"cabin.{name}") for name, *_ in CABIN})
        held = np.zeros(N_CAR)
        held[: len(inputs)] = inputs
        Car(self.value("operating_point"), cabin).step(held, self.value("sample_time_s"))
        car = Car(self.value("operating_point"), cabin)
        return car, held, car.outputs

    def configure(self) -> None:
        """Put the plant at rest at its operating point."""
        self._plant, inputs, outputs = self.make_model()
        at_rest = np.array(rest_at(self.value("operating_point"))["inputs"])
        self._held = np.concatenate([at_rest, inputs[len(at_rest) :]])
        self._taken = len(inputs)  # how many of them the model takes
        self._held[: self._taken] = inputs
        self._plant_outputs = np.array(outputs, dtype=np.float64)
        self._realtime = self.is_realtime
        self._hold = CommandHold(self._held[:2], self.value("sample_time_s"), self.value("command_hold_s"))
        self._sample_time_s: float = self.value("sample_time_s")
        self._tick_ns = round(self._sample_time_s * 1e9)
        self._last_tick: int = self.value("ticks") - 1
        self._first_ns = 0
        self._tick = 0
        self._finished = False
        self._commanded_tick = -1
        self._published_s.clear()
        if not self._realtime:
            self.add_output(Topic("clock", CLOCK, "simulated time", PLANT), "/clock")
        self._faults: tuple[float, ...] = NO_FAULTS
        self._in_car: bool = self.value("in_car")
        played = (*AIR_SIDE, DRIVE) if self._in_car else AIR_SIDE
        faults = "component/faults"
        waits = not self._realtime and self.value("component_faults")
        if not waits:
            self.on_tick((faults,), self._broken)
        if self._realtime:
            self.on_tick(played, self._ventilated, holds_s=dict.fromkeys(played, math.inf))
            self.on_tick(("actuator/command",), self._commanded)
        else:
            self.on_tick(("actuator/command", *played, *((faults,) if waits else ())), self._commanded)

    def started(self) -> None:
        """Publish the first tick."""
        self.soon(self._begin)

    def _begin(self) -> None:
        paused = self._tick in self._published_s or self._commanded_tick >= 0
        if not paused:
            self._started_s = time.monotonic()
            self._first_ns = time.time_ns() if self._realtime else 0
            self._epoch_s = self._started_s  # when tick 0 was, or would have been
        if self._realtime:
            # After a pause the stamps go on by whole ticks; not by the wall clock, which may have been set meanwhile.
            passed = int((time.monotonic() - self._epoch_s) / self._sample_time_s)
            paused_ticks = passed - (self._tick + 1) if paused else 0
            self._first_ns += paused_ticks * self._tick_ns
            self._epoch_s += paused_ticks * self._sample_time_s
            self.loop.deadline_s = self._epoch_s + (self._tick + 1 + paused) * self._sample_time_s
        if paused:
            self._advance()  # the command of the tick in which it was stopped is gone: the one before stays on
        else:
            self._publish()

    def stopped(self) -> None:
        """Stop the deadlines of the wall clock."""
        self.loop.deadline_s = math.inf

    def _publish(self) -> None:
        time_ns = self._first_ns + self._tick * self._tick_ns
        p_e, superheat, wall, p_c = self._plant_outputs.tolist()
        self._published_s[self._tick] = time.monotonic()
        if not self._realtime:
            self.send(time_ns, "clock")
        self.send(time_ns, "plant/evaporator_pressure", p_e)
        self.send(time_ns, "plant/superheat", superheat)
        self.send(time_ns, "plant/wall_temperature", wall)
        acted = getattr(self._plant, "acted", self._held)
        self.send(time_ns, "plant/air_inlet_temperature", float(acted[3]))
        self.send(time_ns, "plant/condenser_pressure", p_c)
        self.send(time_ns, "plant/condenser_air_inlet_temperature", float(acted[5]))
        if self._in_car:
            self.send(time_ns, "plant/car", *getattr(self._plant, "cabin", _UNTOLD_CABIN))
        *joints, vent, subcooling = getattr(self._plant, "performance", _UNTOLD)
        self.send(time_ns, "plant/performance", *joints)
        self.send(time_ns, "plant/vent_temperature", vent)
        self.send(time_ns, "plant/subcooling", subcooling)

    def _commanded(self, time_ns: int, *values: float) -> None:
        """Hold the inputs of a tick from now on; in lockstep that ends the tick."""
        tick, rest = divmod(time_ns - self._first_ns, self._tick_ns)
        if rest or tick not in self._published_s or self._finished:
            return
        told = values[: len(self._held)]
        self._held[: len(told)] = told
        if len(values) > len(told):
            self._broken(time_ns, *values[len(told) :])
        self._hold.commanded(values[:2])
        self._commanded_tick = tick
        self._latencies.add(time.monotonic() - self._published_s.pop(tick))
        if tick == self._tick and not self._realtime:
            self._advance()
        if self._realtime:
            if tick < self._tick:
                end_s = self._epoch_s + (tick + 1) * self._sample_time_s
                self._late_commands.append((tick, round(time.monotonic() - end_s, 6)))
            self.enter("", time_ns)

    def _ventilated(self, time_ns: int, *values: float) -> None:  # noqa: ARG002
        """Hold the air side from now on."""
        self._held[2:] = values

    def _broken(self, time_ns: int, *sizes: float) -> None:  # noqa: ARG002
        """Have these faults from now on."""
        if sizes == self._faults:
            return
        self._faults = sizes
        if isinstance(self._plant, FaultyModel):
            self._plant.hold_faults(sizes)

    def on_deadline(self) -> None:
        """Begin the next tick of the wall clock with the newest command."""
        late_s = time.monotonic() - self.loop.deadline_s
        self._late_wakeups += late_s > LATE_SHARE * self._sample_time_s
        late = int(late_s / self._sample_time_s)
        if late > 0 and self._last_tick >= 0:
            late = min(late, max(self._last_tick - self._tick - 1, 0))  # the last tick is published, however late
        for _ in range(late):  # it was stopped: what it missed goes by in silence, as a plant does not stand still
            self._close_tick()
            self._step()
            self._tick += 1
            self.loop.deadline_s += self._sample_time_s
        self._close_tick()
        self.loop.deadline_s += self._sample_time_s
        self._advance()

    def _close_tick(self) -> None:
        """Count a tick whose command has not come."""
        self._published_s.pop(self._tick - MOST_LATE_TICKS, None)
        if self._commanded_tick >= self._tick:
            return
        self._missed += 1
        self._missed_at.append(self._tick)
        if self._commanded_tick < 0:
            return
        setpoint = self._hold.silent()
        if self._hold.is_over:
            self._held[:2] = setpoint
            self.enter("no command: actuators go to the safe command", self._first_ns + self._tick * self._tick_ns)

    def _advance(self) -> None:
        """Step over the tick with the inputs held, and publish the next one."""
        self._step()
        if self._tick == self._last_tick:
            self._finished = True
            self._wall_s = time.monotonic() - self._started_s
            self.loop.deadline_s = math.inf
            self.soon(self.report_health)
            return
        self._tick += 1
        self._publish()

    def _step(self) -> None:
        assert self._plant is not None
        try:
            self._plant_outputs = self._plant.step(self._held[: self._taken], self._sample_time_s)
        except ValueError as problem:
            msg = f"the plant stopped at {self._tick * self._tick_ns / 1e9:.1f} s: {problem}"
            raise ValueError(msg) from problem

    def node_health(self) -> PlantReport:
        """Return the progress of the run, missed ticks and the latencies of commands."""
        median_s, slow_s, longest_s = (self._latencies.quantile_s(share) for share in (0.5, 0.99, 1.0))
        return PlantReport(
            tick=self._tick,
            finished=self._finished,
            wall_seconds=self._wall_s,
            missed_ticks=self._missed,
            missed_at=tuple(self._missed_at),
            late_commands=tuple(self._late_commands),
            epoch_monotonic_s=self._epoch_s,
            late_wakeups=self._late_wakeups,
            first_ns=self._first_ns,
            command_latency_p50_ms=1e3 * median_s,
            command_latency_p99_ms=1e3 * slow_s,
            command_latency_max_ms=1e3 * longest_s,
            **self._truth(),
        )

    def _truth(self) -> dict[str, Any]:
        """Return what no node of the loop may know, for evaluation only: the paper's state, and the performance."""
        if self._plant is None:
            return {}
        from ac_plant_node import Plant
        from ac_plant_node.dynamics.balances import STATE_NAMES

        plant = getattr(self._plant, "plant", self._plant)  # of a car
        if not isinstance(plant, Plant):
            return {}  # a model of somebody else's
        state = dict(zip(STATE_NAMES, plant.state.tolist(), strict=True))
        return {"internal_state": state, "performance": plant.performance._asdict()}


def main() -> int:
    """Run the node."""
    return run_node(PlantNode)


if __name__ == "__main__":
    sys.exit(main())
