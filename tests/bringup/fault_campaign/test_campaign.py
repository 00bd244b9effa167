"""A campaign through the graph: what cannot begin is refused, and one seed keeps its promises."""

from pathlib import Path

import pytest

from ac_common.errors import UserError
from ac_experiments.campaign.plan import plan
from bringup.cli import main
from bringup.fault_campaign.run import as_dict, run_seed


def test_a_duration_that_is_too_short_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["campaign", "--duration", "3"])
    assert end.value.code == 2
    assert capsys.readouterr().err == "acftc: a campaign's run of 3 s; allowed: 12 to 3600 s\n"


def test_a_run_that_cannot_begin_is_no_broken_promise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "none")
    with pytest.raises(UserError, match="ROS_DOMAIN_ID"):
        run_seed(1, tmp_path / "seed", 18.0)


@pytest.mark.ros
@pytest.mark.clock
@pytest.mark.slow
def test_one_seed_through_the_graph_keeps_its_promises(tmp_path_factory: pytest.TempPathFactory) -> None:
    outcome = run_seed(1, tmp_path_factory.mktemp("campaign"), 18.0)
    # How long a node takes to start again is the machine's business while other tests run: `acftc campaign` shows it.
    promises = [verdict for verdict in outcome.verdicts if not verdict.promise.startswith("back within")]
    assert [f"{verdict.promise}: {verdict.seen}" for verdict in promises if verdict.kept is False] == []
    assert sum(verdict.kept is True for verdict in promises) >= 8
    assert as_dict(outcome)["happens"] == plan(1, 18.0).lines()
