"""Results of a study in a folder, on this machine or anywhere fsspec reaches: partitions, then one file of all runs.

The workers write partitions, each whole or not there. What is done is what the names of the partitions say, so a study
can be gone on with after anything. `runs.parquet` has the rows in order of their number, in row groups of one size: its
bytes do not depend on which worker did what, or when.
"""

import contextlib
import os
import re
import uuid
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import IO, Any

from ac_common.errors import RunError, UserError, one_line
from ac_experiments.study.runs import Row
from ac_experiments.study.schema import Study

STUDY, RUNS, PARTS, MADE_WITH, TIMING = "study.yaml", "runs.parquet", "parts", "made_with.txt", "timing.json"
#: Rows of a row group of `runs.parquet`.
GROUP = 10_000
_PART = re.compile(r"runs-(\d{8})-(\d{8})\.parquet")

#: Columns of what was run, and of what came of it, with their types.
ABOUT = {
    "run": "int64",
    "drive": "int64",
    "operating_point": "string",
    "duration_s": "float64",
    "fault_kind": "string",
    "fault_size": "float64",
    "fault_onset_s": "float64",
}
CONTROL = (
    *("iae_pressure_kpa_s", "iae_superheat_k_s", "peak_pressure_error_kpa", "peak_superheat_error_k"),
    *("least_superheat_k", "compressor_kj", "cooling_kj", "load_kw", "cabin_c"),
)
FIGURES = {
    "outcome": "string",
    "problem": "string",
    "false_alarms": "int64",
    "fault_free_s": "float64",
    "detection_delay_s": "float64",
    "isolation_delay_s": "float64",
    "isolated_as": "string",
    "wrong_name_s": "float64",
    "estimate": "float64",
    "peak_fault_free": "float64",
    "peak_faulty": "float64",
}
#: What a fault changes against the same run without it.
CHANGES = (
    *("change_pressure_kpa", "fault_free_peak_pressure_error_kpa"),
    *("late_change_pressure_kpa", "late_change_superheat_k", "late_change_speed_rpm"),
)


def columns_of(study: Study) -> dict[str, str]:
    """Return the columns of a study's rows with their types; what is drawn and no number is a text."""
    drawn = {f"drawn.{key}": "float64" if one.is_number else "string" for key, one in study.distributions.items()}
    numbers = (*CONTROL, *(CHANGES if study.fault_free else ()))
    alone = [f"k0_{name}" for name in numbers] if study.k0_alone else []
    return {**ABOUT, **drawn, **FIGURES, **dict.fromkeys([*numbers, *alone], "float64")}


def _read(file: IO[bytes]) -> Any:
    """Return the table of a Parquet file, read by this thread alone.

    A thread of Arrow's that still holds a file of Python's when the interpreter ends aborts the process (Arrow's issue
    34314).
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    return pq.ParquetFile(pa.BufferReader(file.read()), pre_buffer=False).read(use_threads=False)


def _table(study: Study, rows: Sequence[Row]) -> Any:
    import pyarrow as pa

    types = {"int64": pa.int64(), "float64": pa.float64(), "string": pa.string()}
    convert: dict[str, Any] = {"int64": int, "float64": _number, "string": str}
    columns = columns_of(study)
    arrays = [
        pa.array(
            [None if row.get(name) is None else convert[kind](row[name]) for row in rows], types[kind], from_pandas=True
        )
        for name, kind in columns.items()
    ]
    return pa.table(arrays, names=list(columns))


def _number(value: Any) -> float:
    return float(value)


class Store:
    """The folder of a study's results.

    Parameters
    ----------
    url : str
        A path, or what fsspec takes, such as ``s3://bucket/study``.
    """

    def __init__(self, url: str) -> None:
        import fsspec

        self.url = url
        try:
            self._fs, self._root = fsspec.core.url_to_fs(url)
        except (ImportError, ValueError) as problem:
            msg = f"{url}: cannot be written to: {one_line(problem)}"
            raise UserError(msg) from None

    @cached_property
    def is_here(self) -> bool:
        """Whether it is a folder of this machine."""
        return self._fs.protocol in ("file", "local") or "file" in self._fs.protocol

    @property
    def folder(self) -> Path:
        """The folder, where it is one of this machine."""
        return Path(self._root)

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"

    def has(self, name: str) -> bool:
        """Whether there is a file of that name."""
        return bool(self._fs.exists(self._at(name)))

    def read(self, name: str) -> bytes:
        """Return the content of a file; raises UserError when there is none."""
        try:
            return bytes(self._fs.cat_file(self._at(name)))
        except OSError as problem:
            msg = f"{self.url}/{name}: cannot be read: {problem.strerror or one_line(problem) or 'it is not there'}"
            raise UserError(msg) from None

    def write(self, name: str, content: bytes) -> None:
        """Write a file that is whole or not there.

        Raises
        ------
        RunError
            When it cannot be written: one line.
        """
        with self._whole(name) as temporary, self._fs.open(temporary, "wb") as file:
            file.write(content)

    @contextlib.contextmanager
    def _whole(self, name: str) -> Iterator[str]:
        """Give a name to write to that takes the place of `name` at the end, unless anything goes wrong."""
        final = self._at(name)
        parent, _, last = final.rpartition("/")
        temporary = f"{parent}/.{last}-{uuid.uuid4().hex}"
        try:
            self._fs.makedirs(parent, exist_ok=True)
            yield temporary
            if self.is_here:
                os.replace(temporary, final)  # noqa: PTH105  (names, as fsspec gives them)
            else:
                self._fs.mv(temporary, final)
        except BaseException as problem:
            with contextlib.suppress(Exception):
                self._fs.rm(temporary)
            if isinstance(problem, OSError):
                msg = f"{self.url}: cannot be written to: {problem.strerror or one_line(problem)}"
                raise RunError(msg) from None
            raise

    def write_part(self, study: Study, rows: Sequence[Row]) -> None:
        """Write the rows of some runs that follow on each other."""
        import pyarrow.parquet as pq

        name = f"{PARTS}/runs-{rows[0]['run']:08d}-{rows[-1]['run']:08d}.parquet"
        table = _table(study, rows)
        with self._whole(name) as temporary, self._fs.open(temporary, "wb") as file:
            pq.write_table(table, file, compression="zstd")

    def parts(self) -> list[tuple[int, int, str]]:
        """Return first and last run and the name of each partition, in order; what is left half is removed."""
        folder = self._at(PARTS)
        if not self._fs.exists(folder):
            return []
        self._fs.invalidate_cache(folder)
        names = [path.rpartition("/")[2] for path in self._fs.ls(folder, detail=False)]
        found = [(match, name) for name in names if (match := _PART.fullmatch(name))]
        return sorted((int(match[1]), int(match[2]), name) for match, name in found)

    def sweep(self) -> None:
        """Remove what processes that were killed have left half."""
        folder = self._at(PARTS)
        if self._fs.exists(folder):
            for path in self._fs.ls(folder, detail=False):
                if path.rpartition("/")[2].startswith("."):
                    with contextlib.suppress(OSError):
                        self._fs.rm(path)

    def missing(self, runs: int) -> list[tuple[int, int]]:
        """Return the stretches of runs, first and count, that no partition has."""
        stretches, following = [], 0
        for first, last, _ in self.parts():
            if first > following:
                stretches.append((following, first - following))
            following = max(following, last + 1)
        if following < runs:
            stretches.append((following, runs - following))
        return stretches

    def merge(self, study: Study) -> None:
        """Write `runs.parquet` from the partitions, some at a time; a run that is in two of them is taken once."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        empty = _table(study, [])
        waiting, following = [empty], 0
        with (
            self._whole(RUNS) as temporary,
            self._fs.open(temporary, "wb") as file,
            pq.ParquetWriter(file, empty.schema, compression="zstd") as writer,
        ):
            for first, last, name in self.parts():
                if last < following:
                    continue
                with self._fs.open(self._at(f"{PARTS}/{name}"), "rb") as part:
                    waiting.append(_read(part).slice(max(following - first, 0)))
                following = last + 1
                while sum(map(len, waiting)) >= GROUP:
                    together = pa.concat_tables(waiting).combine_chunks()
                    writer.write_table(together.slice(0, GROUP), GROUP)
                    waiting = [together.slice(GROUP)]
            rest = pa.concat_tables(waiting).combine_chunks()
            if len(rest):
                writer.write_table(rest, GROUP)

    def table(self) -> Any:
        """Return all runs as a pyarrow table.

        Raises
        ------
        UserError
            When there are none: one line.
        """
        if not self.has(RUNS):
            msg = f"{self.url}: holds no {RUNS}; a study that was cut short is gone on with by `acftc study` --resume"
            raise UserError(msg)
        with self._fs.open(self._at(RUNS), "rb") as file:
            return _read(file)
