"""The table of processes says of each node what the code of the node says itself."""

from importlib import import_module
from importlib.util import find_spec

import pytest

from ac_common.topics import PLANT, RECORDER, TOPICS
from bringup.launch.process_table import ACTIVATION_ORDER, LOOP_NODES, PROCESSES


def test_every_node_of_the_topics_has_a_process() -> None:
    named = {topic.publisher for topic in TOPICS} | {reader for topic in TOPICS for reader in topic.subscribers}
    assert named | {RECORDER} == set(PROCESSES) == {*LOOP_NODES, RECORDER}


def test_the_plant_sets_the_pace_and_is_activated_last_the_recorder_first() -> None:
    assert sorted(process.activated for process in PROCESSES.values()) == list(range(1, len(PROCESSES) + 1))
    assert (ACTIVATION_ORDER[0], ACTIVATION_ORDER[-1]) == (RECORDER, PLANT)


@pytest.mark.parametrize("process", PROCESSES.values(), ids=PROCESSES)
def test_what_the_table_says_is_there(process) -> None:
    assert find_spec(process.module)
    assert process.parameter_file.is_file()
    declared = {parameter.name for parameter in import_module(process.class_module).PARAMETERS}
    assert process.has_design == ("design_file" in declared)
    assert not process.keeps_memory or "memory_file" in declared
