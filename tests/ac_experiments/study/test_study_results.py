"""From rows to words: outcomes, the files of a study, its page, comparison, the worst case."""

import json
import math

import numpy as np
import pytest
from distributed import LocalCluster
from hypothesis import given
from hypothesis import strategies as st

from ac_common.errors import UserError
from ac_common.faults import UNKNOWN
from ac_common.topics import PERFORMANCE_SERIES
from ac_common.units import KPA
from ac_experiments.scenario import check
from ac_experiments.study import outcomes
from ac_experiments.study.cases import Case, Cases
from ac_experiments.study.compare import compare
from ac_experiments.study.engine import begin, run_study
from ac_experiments.study.fault_free import LATE_S
from ac_experiments.study.finish import PAGE, SUMMARY, finish, read_runs
from ac_experiments.study.results import RUNS, Store, columns_of
from ac_experiments.study.runs import designs_for, figures, hold_s, k0_alone_of, play, row_of
from ac_experiments.study.schema import check_study
from ac_experiments.study.summary import Runs, false_alarms, runs_of, summarise_study
from ac_experiments.study.worst import search

# -------------------------------------------------------------------------------------------------------- outcomes


def fault(kind="compressor_speed", detected_s=None, isolated_as=None):
    return {"kind": kind, "detected_s": detected_s, "isolated_as": isolated_as}


@pytest.mark.parametrize(
    ("faults", "alarms", "problem", "outcome"),
    [
        ([], 0, "", outcomes.CORRECT),
        ([], 1, "", outcomes.FALSE_ALARM),
        ([fault()], 0, "", outcomes.MISSED),
        ([fault(detected_s=3.0)], 0, "", outcomes.NO_RESPONSE),
        ([fault(detected_s=3.0, isolated_as="compressor_speed")], 0, "", outcomes.CORRECT),
        ([fault(detected_s=3.0, isolated_as=UNKNOWN)], 0, "", outcomes.MISDIAGNOSED),
        ([fault("valve_stuck", 3.0, UNKNOWN)], 0, "", outcomes.CORRECT),  # no filter is for it
        ([fault("valve_stuck", 3.0, "evaporator_pressure")], 0, "", outcomes.MISDIAGNOSED),
        ([fault(detected_s=3.0, isolated_as="compressor_speed")], 1, "", outcomes.FALSE_ALARM),
        ([fault(detected_s=3.0, isolated_as="compressor_speed"), fault()], 0, "", outcomes.MISSED),
        ([], 0, "the plant stopped", outcomes.NO_RESPONSE),
    ],
)
def test_outcomes_are_in_the_words_of_the_field(faults, alarms, problem, outcome):
    assert outcomes.outcome(faults, alarms, problem) == outcome


def test_a_peak_before_and_after_the_onset_are_told_apart(recording_of):
    run = recording_of(faults=[{"kind": "compressor_speed", "size_rpm": 10, "onset_s": 100}])
    assert outcomes.alarms_before(run, 100.0) == 0
    before, after = outcomes.peaks(run, 100.0, 0.5)
    assert before == 0.0
    assert after == pytest.approx(2.0, rel=1e-2)  # the residual goes to 10 rpm, the threshold is 5
    row = figures(run, 0.5)
    assert (row["outcome"], row["isolation_delay_s"]) == (outcomes.CORRECT, 7.0)
    assert (row["detection_delay_s"], row["fault_free_s"]) == (3.0, 100.0)
    bump = 20.0 * 2.0 / math.pi  # the integral of the ideal run's half a sine, 1 kPa high and 20 s long
    assert row["iae_pressure_kpa_s"] == pytest.approx(bump, rel=1e-3)
    assert row["peak_pressure_error_kpa"] == pytest.approx(1.0, rel=1e-3)


def test_an_early_alarm_is_a_false_one_and_counts_in_its_time(recording_of):
    run = recording_of(faults=[{"kind": "compressor_speed", "size_rpm": 10, "onset_s": 100}])
    run.status[300] = run.status[300]._replace(detected=True)
    run.status[500] = run.status[500]._replace(detected=True)
    row = figures(run, 0.5)
    assert (row["outcome"], row["false_alarms"]) == (outcomes.FALSE_ALARM, 2)


# ----------------------------------------------------------------------------------------------------- real runs


CONTENT = {
    "name": "few",
    "scenario": {"duration_s": 60, "noise": {"superheat_k": 0.02, "evaporator_pressure_kpa": 0.02}},
    "runs": 12,
    "seed": 5,
    "k0_alone": True,
    "vary": {
        "fault.kind": {"grid": ["none", "compressor_speed", "evaporator_pressure"]},
        "fault.typical": {"log_uniform": [0.02, 2]},
        "fault.onset_s": {"uniform": [20, 30]},
    },
}


@pytest.fixture(scope="module")
def here():
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def played(here, tmp_path_factory):
    """A study of few short runs, played and finished."""
    store = Store(str(tmp_path_factory.mktemp("few")))
    run_study(check_study(CONTENT), store, scheduler=here)
    finish(store)
    return store


def test_the_files_of_a_study_say_the_same(played):
    runs, summary = read_runs(played), json.loads(played.read(SUMMARY))
    assert summary["runs"] == len(runs) == 12
    assert sum(of["runs"] for of in summary["outcomes"].values()) == 12
    for kind, row in summary["confusion"].items():
        assert sum(row.values()) == summary["outcomes"][kind]["runs"] == 4
    # The runs of one pass are the same until their faults begin, and one of them has none.
    assert summary["false_alarms"]["hours"] == pytest.approx(4 * 60.0 / 3600.0)
    assert summary["benefit"]["none"]["iae_pressure_kpa_s"]["pairs"] == 4
    assert len(summary["worst"]) == 10
    page = played.read(PAGE).decode()
    assert f"acftc study rerun {played.url} {summary['worst'][0]['run']}" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert 'id="packed"' in page


def rows_of(study, **columns):
    """Rows of a study as they are read."""
    count = len(next(iter(columns.values())))
    content = {"run": np.arange(count), "problem": np.full(count, ""), "false_alarms": np.zeros(count), **columns}
    return Runs(study, {name: np.asarray(values) for name, values in content.items()})


def test_no_time_without_a_fault_counts_twice():
    """Until the fault begins the runs of one pass through the grids are one and the same."""
    grid = {"fault.kind": {"grid": ["none", "compressor_speed"]}}
    study = check_study({"name": "shared", "runs": 6, "vary": grid})
    told = {"false_alarms": [1, 1, 0, 0, 1, 0], "fault_free_s": [1500.0, 900.0, 1500.0, 900.0, 1500.0, 900.0]}
    of_fault = {"drawn.fault.kind": ["none", "compressor_speed"] * 3}
    alarms = false_alarms(rows_of(study, **told, **of_fault))
    assert (alarms["count"], alarms["hours"]) == (2, 1.25)
    # What else is drawn makes another run of it.
    other = false_alarms(rows_of(study, **told, **of_fault, **{"drawn.noise.superheat_k": np.arange(6.0)}))
    assert (other["count"], other["hours"]) == (3, 2.0)
    # And so does the next pass.
    assert false_alarms(rows_of(check_study({"name": "alone", "runs": 6}), **told))["count"] == 3


def test_a_peak_above_one_is_a_detection(played):
    """The statistic that is kept for the characteristic is that of the decision, run by run."""
    runs = read_runs(played)
    faulty = runs.where(runs["fault_kind"] != "none")
    assert 0 < (faulty["peak_faulty"] > 1.0).sum() < len(faulty)
    assert np.array_equal(faulty["peak_faulty"] > 1.0, np.isfinite(faulty["detection_delay_s"]))
    assert not (runs["peak_fault_free"] > 1.0).any()
    assert not runs["false_alarms"].any()


def test_a_run_played_again_is_its_row(played):
    runs, cases = read_runs(played), Cases(check_study(CONTENT))
    for run in (4, 11):
        row = row_of(cases[run], k0_alone=True)
        place = int(np.flatnonzero(runs["run"] == run)[0])
        for name, value in row.items():
            stored = runs[name][place]
            assert stored == value or (value is None and stored != stored) or (value is None and stored is None)


@pytest.mark.parametrize("design", ["paper", "envelope"])
def test_k0_alone_beside_a_run_is_that_of_a_passive_run(design):
    """Whether it is played or the run itself: a run without q is one with K0 alone."""
    fault = {"fault.onset_s": 30, "fault.size": 40}
    kinds = {"fault.kind": {"grid": ["none", "compressor_speed"]}}
    cases, is_played = Cases(check_study({**CONTENT, "set": {"design": design, **fault}, "vary": kinds})), []
    for run in range(2):
        recording, passive = play(cases[run]), play(cases[run], passive=True)
        beside = k0_alone_of(cases[run], recording)
        is_played.append(beside is not recording)
        for key in ("plant/evaporator_pressure", "plant/superheat", *PERFORMANCE_SERIES):
            assert np.array_equal(beside.series[key], passive.series[key]), key
    assert any(is_played)
    assert not all(is_played) or design == "paper"  # where the guard answers to noise


def test_what_a_fault_changes_is_the_run_minus_the_same_without_it():
    """By hand from two recordings; K0 alone, which does not know of the fault, is changed by other amounts."""
    content = CONTENT | {"scenario": CONTENT["scenario"] | {"duration_s": 120}, "fault_free": True}
    cases = Cases(check_study(content))
    case = next(cases[run] for run in range(12) if "evaporator_pressure" in cases[run].drawn.values())
    row = row_of(case, k0_alone=True, fault_free=True)
    plain = Case(0, {}, check({**case.scenario.model_dump(mode="json"), "faults": []}), None, None)
    for prefix, passive in (("", None), ("k0_", True)):
        run, without = play(case, passive), play(plain, passive)
        off = np.abs(run.series["plant/evaporator_pressure"] - without.series["plant/evaporator_pressure"]) / KPA
        onset_s = case.scenario.faults[0].onset_s
        assert row[f"{prefix}change_pressure_kpa"] == off[run.time_s >= onset_s].max() > 0.0
        assert row[f"{prefix}late_change_pressure_kpa"] == off[run.time_s >= onset_s + LATE_S].max()
        assert row[f"{prefix}fault_free_peak_pressure_error_kpa"] < row[f"{prefix}peak_pressure_error_kpa"]
    assert set(row) <= set(columns_of(cases.study))


def test_a_run_that_cannot_go_on_is_a_row_too(monkeypatch):
    from ac_common.errors import RunError

    def stop(*_, **__):
        raise RunError("the plant stopped at 3.0 s")

    monkeypatch.setattr("ac_experiments.study.runs.play", stop)
    row = row_of(Cases(check_study(CONTENT))[1], k0_alone=True)
    assert (row["outcome"], row["problem"]) == (outcomes.NO_RESPONSE, "the plant stopped at 3.0 s")


def test_a_partition_begun_twice_is_taken_once(tmp_path):
    """Two clients may have played the same runs, cut into batches in another way."""
    study = check_study({"name": "made_up", "runs": 10})
    store = Store(str(tmp_path))
    begin(study, store, resume=False)
    rows = [{"run": run, "fault_kind": "none", "outcome": outcomes.CORRECT, "problem": ""} for run in range(10)]
    for first, last in ((0, 3), (2, 5), (4, 4), (6, 9)):
        store.write_part(study, rows[first : last + 1])
    assert store.missing(12) == [(10, 2)]
    store.merge(study)
    assert store.table()["run"].to_pylist() == list(range(10))


@given(st.sets(st.integers(0, 19), min_size=1))
def test_what_is_missing_is_what_no_partition_has(present):
    store = Store("memory://missing")
    store._fs.rm(store._root, recursive=True) if store._fs.exists(store._root) else None
    for run in present:
        store.write(f"parts/runs-{run:08d}-{run:08d}.parquet", b"")
    missing = {run for first, count in store.missing(20) for run in range(first, first + count)}
    assert missing == set(range(20)) - present


# ------------------------------------------------------------------------------------------------------ comparison


def test_a_study_beside_itself_differs_in_nothing(played):
    runs = read_runs(played)
    for row in compare(runs, runs):
        assert row.difference.value == 0.0
        assert row.difference.low <= 0.0 <= row.difference.high
        assert row.paired or row.what == "false alarms per hour"


def test_nothing_is_missed_where_no_fault_was(played):
    runs = read_runs(played)
    healthy = runs.where(runs["fault_kind"] == "none")
    shares = {row.what for row in compare(healthy, healthy) if row.what.endswith("share")}
    assert shares == {"correct, share", "false alarm, share"}


def test_a_known_difference_is_found_pairwise(played):
    """An error that is 1 kPa s larger in each run is that with certainty, though runs differ by far more."""
    runs = read_runs(played)
    more = Runs(runs.study, {**runs.columns, "iae_pressure_kpa_s": runs["iae_pressure_kpa_s"] + 1.0})
    (row,) = [row for row in compare(runs, more) if row.what == "iae_pressure_kpa_s"]
    assert row.paired == 12
    assert tuple(row.difference) == pytest.approx((1.0, 1.0, 1.0))
    ratio = 1.0 + 1.0 / runs["iae_pressure_kpa_s"]
    assert row.ratio == pytest.approx((ratio.mean(), ratio.max()))
    other = Runs(runs.study.model_copy(update={"seed": 6}), more.columns)
    (row,) = [row for row in compare(runs, other) if row.what == "iae_pressure_kpa_s"]
    assert row.paired == 0
    assert row.difference.low < 0.0 < row.difference.high


# ------------------------------------------------------------------------------------------------------ worst case


def test_the_worst_case_is_worse_than_what_chance_finds(here):
    """Of a fault of 0 to 60 rpm at any time the error is largest for the largest; the search gets there."""
    study = check_study(
        {
            "name": "bounds",
            "scenario": {"duration_s": 30},
            "runs": 4,
            "set": {"fault.kind": "compressor_speed", "fault.onset_s": 5},
            "vary": {"fault.size": {"uniform": [0, 60]}},
        }
    )
    found = search(study, "peak_pressure_error_kpa", 40, scheduler=here)
    assert found.case.drawn["fault.size"] > 55.0
    recording = play(found.case)
    assert figures(recording, hold_s(designs_for(found.case.scenario).fdi))["peak_pressure_error_kpa"] == found.value
    again = search(study, "peak_pressure_error_kpa", 40, scheduler=here)
    assert (again.value, again.tried) == (found.value, found.tried)


def test_a_metric_that_is_none_is_refused():
    with pytest.raises(UserError, match="did you mean 'near_false_alarm'"):
        search(check_study(CONTENT), "near_fals_alarm", 20)
    with pytest.raises(UserError, match="nothing varies"):
        search(check_study({"name": "fixed"}), "harm", 20)


def test_a_summary_of_one_healthy_run_has_no_holes(tmp_path):
    study = check_study({"name": "one", "runs": 1, "scenario": {"duration_s": 5}})
    store = Store(str(tmp_path))
    begin(study, store, resume=False)
    store.write_part(study, [row_of(Cases(study)[0], k0_alone=False)])
    store.merge(study)
    summary = summarise_study(runs_of(study, store.table()))
    assert summary["outcomes"]["none"]["correct"] == 1
    assert summary["roc"] == {}
    finish(store)
    assert store.has(PAGE)
    assert store.has(RUNS)
