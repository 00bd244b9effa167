"""What a simulated run leaves behind for others: its bag, and tables of it for other programs."""

import csv
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from rosbags.highlevel import AnyReader
from scipy.io import loadmat

from ac_common.errors import UserError
from ac_common.topics import CABIN_SERIES, CAR_SERIES, SERIES, TICKED
from ac_experiments.bags.export import column_of, export, table_of, unit_of
from ac_experiments.bags.reader import read_bag
from ac_experiments.bags.simulated import write_bag
from ac_experiments.designs import designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

#: Both faults, one without a filter, and so little air that the protection acts: all that a run can tell of.
SETTINGS = (
    "duration_s=40",
    "faults=[{kind: compressor_speed, size_rpm: 60, onset_s: 4}, {kind: valve_slow, size_s: 2, onset_s: 8, end_s: 12}]",
    "air.mass_flow_percent=[{at_s: 15, to: -80}]",
    "noise={superheat_k: 0.05, seed: 3}",
)


@pytest.fixture(scope="module")
def run() -> Recording:
    return simulate(load("nominal", SETTINGS))


@pytest.fixture(scope="module")
def bag(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "bag"
    write_bag(folder, run, designs_of(load("nominal", SETTINGS)))
    return folder


def test_the_bag_reads_back_as_the_run(run: Recording, bag: Path) -> None:
    again = read_bag(bag)
    np.testing.assert_array_equal(again.time_s, run.time_s)
    assert list(again.series) == [key for key in SERIES if key in again.series]
    for key, values in run.series.items():
        np.testing.assert_array_equal(again.series[key], values, err_msg=key)
    np.testing.assert_array_equal([row[3:6] for row in again.status], [row[3:6] for row in run.status])
    assert [row[:3] + row[6:] for row in again.status] == [row[:3] + row[6:] for row in run.status]
    assert run.metadata["events"]
    for key in ("scenario", "mode", "passive", "events", "restarts", "wall_seconds", "complete", "missed_ticks"):
        assert again.metadata[key] == run.metadata[key], key
    assert again.metadata["unreadable"] == 0


def test_a_program_of_somebody_else_reads_the_bag(run: Recording, bag: Path) -> None:
    with AnyReader([bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert all(counts[f"/ac/{topic.name}"] == len(run.time_s) for topic in TICKED)
    assert counts["/ac/fault/valve_slow"] == 41  # from 8.0 to 12.0 s, the zero at the end included
    assert counts["/clock"] == len(run.time_s)


def test_the_names_of_columns_tell_units_and_fit_every_program() -> None:
    keys = (*SERIES, *CAR_SERIES, *CABIN_SERIES)
    names = [column_of(key) for key in keys]
    assert len(set(names)) == len(names)
    for name in names:
        assert name.isidentifier()
        assert len(name) <= 63, name  # MATLAB's longest
    assert column_of("plant/evaporator_pressure") == "plant_evaporator_pressure_pa"
    assert column_of("plant/superheat") == "plant_superheat_k"
    assert column_of("plant/wall_temperature") == "plant_wall_temperature_degc"
    assert column_of("controller/command:compressor") == "controller_command_compressor_rad_s"
    assert column_of("controller/command:expansion_valve") == "controller_command_expansion_valve_share"
    assert column_of("plant/performance:cooling") == "plant_performance_cooling_w"
    assert unit_of("scenario/air_humidity") == "0..1"


@pytest.mark.parametrize("form", ["csv", "parquet", "mat"])
def test_a_table_holds_the_run_to_the_last_bit(form: str, run: Recording, tmp_path: Path) -> None:
    file = tmp_path / f"run.{form}"
    export(run, file, form)
    texts = ("fdi_isolated", "fdi_also_isolated", "fdi_unsure")
    if form == "csv":
        rows = list(csv.DictReader(file.open()))
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        numbers = {
            name: np.array([float(text or "nan") for text in column])
            for name, column in columns.items()
            if name not in texts
        }
        isolated = columns["fdi_isolated"]
    elif form == "parquet":
        table = pq.read_table(file)
        numbers = {name: table[name].to_numpy() for name in table.column_names if name not in texts}
        isolated = table["fdi_isolated"].to_pylist()
        assert json.loads(table.schema.metadata[b"acftc_run"])["mode"] == "simulate"
    else:
        found = loadmat(file, squeeze_me=True)
        numbers = {
            name: values for name, values in found.items() if isinstance(values, np.ndarray) and values.dtype == float
        }
        isolated = [str(text) if len(text) else "" for text in found["fdi_isolated"]]
        assert json.loads(str(found["run"]))["mode"] == "simulate"
    wanted = {name: column for name, column in table_of(run).items() if not isinstance(column, list)}
    assert set(numbers) == set(wanted)
    for name, values in wanted.items():
        np.testing.assert_array_equal(numbers[name], values, err_msg=name)
    assert isolated == [row.isolated or "" for row in run.status]
    named = np.array([name == "compressor_speed" for name in isolated])
    assert named.any()
    assert np.isfinite(numbers["fdi_size_compressor_speed_rad_s"][named]).all()


def test_another_form_is_refused(run: Recording, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="'xls'; allowed: csv, parquet, mat"):
        export(run, tmp_path / "run.xls", "xls")
