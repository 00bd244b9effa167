"""The node `ac_plant` as a real process over DDS, driven to the edges of the permitted box and beyond them."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ac_common.topics import AIR_SIDE, BY_NAME, PLANT
from ac_common.wire import columns, packer
from ac_plant_node import Plant
from ac_plant_node.inputs import INPUT_HIGH, INPUT_LOW
from bringup.launch.node_parameters import node_arguments
from bringup.launch.processes import Domain, ros_environment, start, stop
from bringup.launch.supervisor import Supervisor
from bringup.replay.feeder import Feeder

pytestmark = pytest.mark.ros

SAMPLE_TIME_S = 0.1
INPUTS = ("actuator/command", *AIR_SIDE)
OUTPUTS = tuple(
    f"plant/{name}" for name in ("evaporator_pressure", "superheat", "wall_temperature", "condenser_pressure")
)
PATIENCE_S = 10.0


class Loop:
    """What stands around the plant in lockstep: tells it the inputs of a tick, waits for the outputs of the next.

    A twin in this process gets the same inputs.
    """

    def __init__(self, feeder: Feeder) -> None:
        self._feeder, self._tick = feeder, 0
        self._twin = Plant.at("med")
        self.rest = self._twin.inputs.copy()

    def outputs(self) -> NDArray[np.float64]:
        """Outputs (4,) at the present tick."""
        time_ns = round(self._tick * SAMPLE_TIME_S * 1e9)
        wanted = {name: packer(BY_NAME[name])(time_ns, (0.0,)) for name in OUTPUTS}
        answers = self._feeder.collect(wanted, PATIENCE_S)
        assert answers is not None, f"no outputs at tick {self._tick}"
        return np.array([columns(BY_NAME[name], [answers[name]])[0][0] for name in OUTPUTS])

    def tell(self, w: NDArray[np.float64], *names: str) -> None:
        """Inputs (7,) of the present tick, or only those on the topics `names`."""
        time_ns = round(self._tick * SAMPLE_TIME_S * 1e9)
        values = dict(zip(INPUTS, (w[:2], *w[2:, np.newaxis]), strict=True))
        self._feeder.publish(
            [(BY_NAME[name], packer(BY_NAME[name])(time_ns, values[name])) for name in names or INPUTS]
        )

    def check(self, w: NDArray[np.float64]) -> None:
        """Advance by a tick with inputs `w`: node and twin must agree to the last bit."""
        self.tell(w)
        self._tick += 1
        expected = self._twin.step(w, SAMPLE_TIME_S)
        assert np.isfinite(expected).all()
        assert (self.outputs() == expected).all(), w


@pytest.fixture(scope="module")
def loop() -> Iterator[Loop]:
    domain = Domain()
    environment = {**ros_environment(), "ROS_DOMAIN_ID": str(domain.number)}
    with tempfile.TemporaryDirectory() as folder:
        own = {"operating_point": "med", "sample_time_s": SAMPLE_TIME_S, "mode": "lockstep"}
        child = start(PLANT, node_arguments(PLANT, own, Path(folder)), Path(folder), environment)
        try:
            with Supervisor({PLANT: child}, environment) as supervisor:
                feeder = Feeder(supervisor, PLANT)
                supervisor.connect([PLANT], feeder.is_matched)
                supervisor.activate([PLANT])
                made = Loop(feeder)
                made.outputs()
                yield made
        finally:
            stop([child])
            domain.release()


def test_runs_at_the_edges_and_stops_at_them(loop: Loop) -> None:
    """Bit for bit what `Plant.step` gives, which clips to the permitted box; the node outlives every corner of it."""
    corners = [
        np.where([bool(k >> i & 1) for i in range(len(INPUT_LOW))], INPUT_HIGH, INPUT_LOW)
        for k in range(0, 2 ** len(INPUT_LOW), 5)
    ]
    beyond = [
        np.array([740.0, 1.0, 2.0, 80.0, 3.0, 80.0, 1.0]),  # 7066 rpm, gales of hot air
        np.array([0.0, 0.0, 0.0, -40.0, 0.0, -40.0, 0.0]),  # no air at all
        # A fault of 40 rpm on top of the fastest command.
        np.array([INPUT_HIGH[0] + 4.2, 0.55, 0.31, 50.1, 0.55, 30.0, 0.0]),
    ]
    for w in (*corners, *beyond, loop.rest):
        for _ in range(15):
            loop.check(w)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(("position", "name"), [(0, INPUTS[0]), *enumerate(INPUTS, start=1)], ids=str)
def test_what_is_not_finite_is_refused_and_the_tick_waits_for_a_number(
    loop: Loop, position: int, name: str, value: float
) -> None:
    """The plant never sees it: with the good message that follows it goes on as if nothing had been sent."""
    w = loop.rest.copy()
    w[position] = value
    loop.tell(w, name)
    loop.check(loop.rest)
