"""A recording as one table for other programs: a row for each tick, a column for each signal, its unit in its name."""

import csv
import json
from collections.abc import Callable, Mapping
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.faults import ISOLABLE
from ac_common.fdi_status import StatusRow
from ac_common.files import write_whole
from ac_common.topics import BY_NAME, JOINT_UNIT, JOINTS
from ac_experiments.recording import Recording

#: A column: numbers, or texts.
Column = NDArray[np.float64] | list[str]

#: What is told of names: fields of `StatusRow`.
_NAMED = ("isolated", "also_isolated", "unsure")
#: How a unit is written at the end of a name.
_SUFFIX = {"0..1": "share", "0 or 1": "flag", "°C": "degc"}


def unit_of(key: str) -> str:
    """Return the unit of a series of a recording."""
    name, _, joint = key.partition(":")
    topic = BY_NAME[name]
    return JOINT_UNIT[joint] if topic.type == JOINTS else topic.unit


def column_of(key: str) -> str:
    """Return the name of a series' column: a name that every program takes, with the unit at its end.

    ``controller/command:compressor`` becomes ``controller_command_compressor_rad_s``.
    """
    return _named(key, unit_of(key))


def table_of(recording: Recording) -> dict[str, Column]:
    """Return a recording as columns by name, all of the same length; SI, temperatures of air and wall in degC.

    First ``time_s``, then the signals in the order of the topics, then what ``fdi/status`` said: ``fdi_detected_flag``,
    ``fdi_isolated``, ``fdi_also_isolated`` and ``fdi_unsure`` (texts, empty while there is no such fault), the size of
    the isolated fault in a column of its kind, and the thresholds. What was not recorded is nan.
    """
    table: dict[str, Column] = {"time_s": recording.time_s}
    table |= {column_of(key): values for key, values in recording.series.items()}
    return table | _decisions(recording)


def _decisions(recording: Recording) -> dict[str, Column]:
    rows: list[StatusRow | None] = [None] * len(recording.time_s)
    step_s = float(recording.metadata["sample_time_s"])
    for row in recording.status:
        if 0 <= (at := round(row.time_s / step_s)) < len(rows):
            rows[at] = row

    def numbers(value: Callable[[StatusRow], float]) -> Column:
        return np.array([np.nan if row is None else value(row) for row in rows])

    found: dict[str, Column] = {
        "fdi_detected_flag": numbers(lambda row: float(row.detected)),
        **{f"fdi_{name}": ["" if row is None else getattr(row, name) or "" for row in rows] for name in _NAMED},
    }
    for place, fault in enumerate(ISOLABLE):
        found[_named(f"fdi/size/{fault.kind}", fault.si_unit)] = numbers(
            lambda row, kind=fault.kind: row.size if row.isolated == kind else np.nan  # type: ignore[misc]
        )
        found[_named(f"fdi/threshold/{fault.kind}", fault.si_unit)] = numbers(
            lambda row, place=place: row.thresholds[place]  # type: ignore[misc]
        )
    return found


def _named(key: str, unit: str) -> str:
    suffix = _SUFFIX.get(unit, unit).lower().replace("/", "_")
    return f"{key.replace('/', '_').replace(':', '_')}_{suffix}"


# -------------------------------------------------------------------------------------------------------- the files


def export(recording: Recording, file: Path, form: str) -> None:
    """Write a recording as a table.

    Parameters
    ----------
    recording
    file
        Written whole or not at all.
    form
        "csv", "parquet" or "mat" (MATLAB 5, which Octave and scipy read, too). A parquet file says in its metadata
        (``acftc_run``), a mat file in ``run``, as JSON, what was run.

    Raises
    ------
    UserError
        When there is no such form.
    RunError
        When the file cannot be written.
    """
    if form not in FORMS:
        msg = f"no table of the form {form!r}; allowed: {', '.join(FORMS)}"
        raise UserError(msg)
    write_whole(file, FORMS[form](table_of(recording), json.dumps(recording.metadata, default=str)))


def _csv(table: Mapping[str, Column], run: str) -> bytes:  # noqa: ARG001
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*(_texts(column) for column in table.values()), strict=True))
    return text.getvalue().encode()


def _texts(column: Column) -> list[str]:
    """Return the shortest texts that read back to the same bits; an empty one where there is no number."""
    if isinstance(column, list):
        return column
    return ["" if value != value else repr(value) for value in column.tolist()]


def _parquet(table: Mapping[str, Column], run: str) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = [pa.array(column) for column in table.values()]
    stream = BytesIO()
    pq.write_table(pa.table(columns, names=list(table), metadata={"acftc_run": run}), stream, compression="zstd")
    return stream.getvalue()


def _mat(table: Mapping[str, Column], run: str) -> bytes:
    from scipy.io import savemat

    variables: dict[str, Any] = {
        name: np.array(column, dtype=object) if isinstance(column, list) else column for name, column in table.items()
    }
    stream = BytesIO()
    savemat(stream, {**variables, "run": run}, do_compression=True, oned_as="column", long_field_names=True)
    return stream.getvalue()


FORMS: dict[str, Callable[[Mapping[str, Column], str], bytes]] = {"csv": _csv, "parquet": _parquet, "mat": _mat}
