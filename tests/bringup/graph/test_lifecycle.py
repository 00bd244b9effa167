"""The life cycle as `ros2 lifecycle` would drive it: a node acts on its inputs only while it is active."""

from pathlib import Path

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition

from ac_common.errors import RunError
from ac_common.topics import BY_NAME, CONTROLLER, TOPICS, Topic
from ac_common.wire import packer
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import load
from bringup.launch.launch import node_arguments, run_graph
from bringup.launch.node_modules import MODULES
from bringup.launch.processes import Child, ros_environment, start, stop
from bringup.launch.supervisor import Supervisor
from bringup.replay.feeder import Feeder
from tests.designs import design_parameters
from tests.operator import Operator

pytestmark = pytest.mark.ros

INPUTS = [topic for topic in TOPICS if CONTROLLER in topic.subscribers]


def tick(k: int) -> list[tuple[Topic, bytes]]:
    return [(topic, packer(topic)(k * 100_000_000, [sum(span) / 2 for span in topic.spans])) for topic in INPUTS]


def command_of(feeder: Feeder, k: int, patience_s: float = 10.0) -> bytes | None:
    """The command for tick k, when it comes."""
    expected = {"controller/command": packer(BY_NAME["controller/command"])(k * 100_000_000, [0.0, 0.0])}
    return (feeder.collect(expected, patience_s) or {}).get("controller/command")


def start_controller(folder: Path) -> Child:
    own = design_parameters(CONTROLLER, folder)
    return start(CONTROLLER, node_arguments(MODULES[CONTROLLER], CONTROLLER, own, folder), folder, ros_environment())


def test_controller_acts_only_while_it_is_active(tmp_path: Path) -> None:
    child = start_controller(tmp_path)
    try:
        with Supervisor({CONTROLLER: child}, ros_environment()) as supervisor:
            feeder = Feeder(supervisor, CONTROLLER)
            supervisor.connect([CONTROLLER], feeder.is_matched)
            feeder.publish(tick(0))
            assert command_of(feeder, 0, patience_s=0.3) is None  # inactive
            supervisor.activate([CONTROLLER])
            feeder.publish(tick(1))
            assert command_of(feeder, 1) is not None
            supervisor.change([CONTROLLER], Transition.TRANSITION_DEACTIVATE, "inactive")
            feeder.publish(tick(2))
            assert command_of(feeder, 2, patience_s=0.3) is None
            supervisor.change([CONTROLLER], Transition.TRANSITION_ACTIVATE, "active")
            feeder.publish(tick(3))
            assert command_of(feeder, 3) is not None
            assert feeder.got == {}  # nothing late for tick 2
            supervisor.change([CONTROLLER], Transition.TRANSITION_DEACTIVATE, "inactive")
            supervisor.change([CONTROLLER], Transition.TRANSITION_CLEANUP, "unconfigured")
            supervisor.connect([CONTROLLER], feeder.is_matched)
            supervisor.activate([CONTROLLER])
            feeder.publish(tick(0))  # a new life: time may begin anew
            assert command_of(feeder, 0) is not None
    finally:
        stop([child])


def test_a_transition_that_a_state_does_not_have_is_refused_and_nobody_dies(tmp_path: Path) -> None:
    """As when somebody types `ros2 lifecycle set /ac/gimc_controller activate` twice."""
    child = start_controller(tmp_path)
    try:
        with Supervisor({CONTROLLER: child}, ros_environment()) as supervisor:
            for transition in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP):
                with pytest.raises(RunError, match="cannot start"):
                    supervisor.change([CONTROLLER], transition, "active")
            supervisor.change([CONTROLLER], Transition.TRANSITION_CONFIGURE, "inactive")  # it is alive, and as it was
    finally:
        stop([child])


@pytest.mark.clock
def test_plant_goes_on_after_a_pause(tmp_path: Path) -> None:
    """Deactivated and activated again, as from `ros2 lifecycle`, the loop takes up where it was."""
    paused: list[int] = []

    def pause(done: int, _ticks: int) -> None:
        if done > 0 and not paused:
            paused.append(done)
            with Operator() as operator:
                operator.change("ac_plant", Transition.TRANSITION_DEACTIVATE)
                operator.change("ac_plant", Transition.TRANSITION_ACTIVATE)

    run = run_graph(load("nominal", ["duration_s=8"]), tmp_path, mode="realtime", care=True, progress=pause)
    assert paused
    recording = read_bag(run.bag)
    assert len(recording.time_s) >= 80
    superheat = recording.series["plant/superheat"]
    np.testing.assert_allclose(superheat[np.isfinite(superheat)][-1], 20.0, atol=0.01)
