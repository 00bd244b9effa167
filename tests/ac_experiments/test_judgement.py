"""Verdicts of the reproduction: each rule can say yes and no."""

import json
from pathlib import Path

import pytest

from ac_experiments.paper import reproduce as reproduction
from ac_experiments.paper.judgement import (
    AGREES,
    BETTER,
    DIFFERS,
    LEFT_OUT,
    NOTED,
    Experiment,
    at_least,
    at_most,
    near,
    noted,
    toward,
)


@pytest.mark.parametrize(
    ("finding", "verdict"),
    [
        (near("N", "rpm", -40.1, -40, 0.2), AGREES),
        (near("N", "rpm", -39.7, -40, 0.2), DIFFERS),
        (near("N", "rpm", None, -40, 0.2), DIFFERS),
        (at_most("p", "kPa", -0.2, 0.3), AGREES),
        (at_most("p", "kPa", -0.4, 0.3), DIFFERS),
        (at_most("t", "s", None, 60), DIFFERS),
        (at_least("r", "rpm", -50.0, 40), AGREES),
        (at_least("r", "rpm", 30.0, 40), DIFFERS),
        (toward("N", "rpm", 10.5, 10, 0, 1), AGREES),
        (toward("N", "rpm", -0.4, 10, 0, 1), BETTER),
        (toward("N", "rpm", 12.0, 10, 0, 1), DIFFERS),
        (toward("N", "rpm", -30.0, 10, 0, 1), DIFFERS),
        (noted("p", "kPa", 3.0), NOTED),
    ],
)
def test_rules(finding, verdict):
    assert finding.verdict == verdict


def test_an_experiment_is_as_good_as_its_worst_finding():
    good, better, bad = near("a", "", 1, 1, 0.1), toward("b", "", 0, 2, 0, 1), near("c", "", 2, 1, 0.1)
    assert Experiment("E", "", [good, better]).verdict == AGREES
    assert Experiment("E", "", [good, bad, better]).verdict == DIFFERS
    assert Experiment("E", "", [noted("n", "", 1.0)]).verdict == NOTED
    assert Experiment("E", "").verdict == LEFT_OUT


def test_what_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # The experiments themselves are tested where their plant and designs are; here: files and their content.
    made_up = Experiment(
        "E5", "Made up", [near("N", "rpm", -39.9, -40, 0.2), noted("x", "", float("nan"))], "why", "<svg/>"
    )
    for name in ("operating_points", "isolation", "isolation_two_sensors", "isolation_disturbed", "sensor_fault"):
        monkeypatch.setattr(reproduction, name, lambda name=name: Experiment(name, "t", [], "left out"))
    monkeypatch.setattr(reproduction, "compensators", lambda: Experiment("E7", "t"))
    monkeypatch.setattr(reproduction, "actuator_fault", lambda: made_up)
    said: list[str] = []
    reproduction.reproduce(tmp_path, None, said.append)
    content = json.loads((tmp_path / "paper.json").read_text())
    assert content["E5"]["verdict"] == AGREES
    assert content["E5"]["findings"][0] == {
        "quantity": "N",
        "unit": "rpm",
        "paper": -40,
        "ours": -39.9,
        "verdict": AGREES,
        "rule": "-40 ± 0.2 rpm",
    }
    assert content["E5"]["findings"][1]["ours"] is None
    assert "cycle" in content["E8"]["remark"]
    assert (tmp_path / "e5.svg").read_text() == "<svg/>"
    assert "Made up" in (tmp_path / "index.html").read_text()
    assert len(said) == 8
