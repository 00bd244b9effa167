"""Every node still answers as in the reference bag, to the rounding of another processor.

A difference is a change of behaviour. When it is wanted: ``python tests/bringup/graph/update_references.py``.
"""

import platform

import pytest
from update_references import REFERENCE, SCENARIO

from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import load
from bringup.launch.process_table import LOOP_NODES
from bringup.replay.replay import replay

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("node", LOOP_NODES)
def test_node_behaves_as_in_the_reference(node: str) -> None:
    result = replay(REFERENCE, node)
    assert result.same, [f"{result.different} of {result.compared} messages differ", *result.differences]


def test_reference_exercises_detection_and_accommodation() -> None:
    recording = read_bag(REFERENCE)
    assert recording.metadata["scenario"] == load(SCENARIO).model_dump(mode="json")
    assert recording.status[-1].isolated == "compressor_speed"
    assert abs(recording.series["compensator/q:compressor"][-1]) > 0.0


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the switches below are those of x86-64")
def test_another_processor_rounds_within_the_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")  # 2004: no AVX, no fused multiply-add
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "AVX2,FMA3")
    for node in ("fdi", "compensator", "gimc_controller"):
        result = replay(REFERENCE, node)
        assert result.same, result.differences
