"""Parameters of the plant: read from YAML, checked against their ranges, flat for the compiled code."""

import difflib
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from ac_plant_node.tables import REFRIGERANTS

NAMES = (
    "charge_kg",
    "evaporator_volume_m3",
    "evaporator_inner_area_m2",
    "evaporator_wall_j_k",
    "evaporator_two_phase_w_m2k",
    "evaporator_superheated_w_m2k",
    "evaporator_air_ua_w_k",
    "evaporator_air_nominal_kg_s",
    "condenser_volume_m3",
    "condenser_inner_area_m2",
    "condenser_wall_j_k",
    "condenser_superheated_w_m2k",
    "condenser_two_phase_w_m2k",
    "condenser_subcooled_w_m2k",
    "condenser_air_ua_w_k",
    "condenser_air_kg_s",
    "condenser_air_inlet_k",
    "air_cp_j_kgk",
    "air_ua_exponent",
    "displacement_m3_rev",
    "isentropic_efficiency",
    "eta_v_offset",
    "eta_v_pressure_ratio",
    "eta_v_speed",
    "valve_discharge_coefficient",
    "valve_area_0_m2",
    "valve_area_1_m2",
    "valve_area_2_m2",
)
"""Names of the parameters, in the order of `Parameters.array`."""

INDEX = {name: i for i, name in enumerate(NAMES)}
"""Position of each parameter in `Parameters.array`."""

SOLVED = NAMES[21:24] + NAMES[25:28]
"""The parameters that calibration solves for."""


PLANT_VARIABLE = "ACFTC_PLANT"
"""Environment variable that names the parameter file of a plant of your own (``acftc --plant FILE`` sets it)."""


@dataclass(frozen=True)
class TableRow:
    """One operating point as it was measured: air inlet, inputs, and the rest they lead to.

    The air flow is the nominal one of the parameters where `air_mass_flow_kg_s` is None.
    """

    name: str
    air_inlet_temperature_c: float
    compressor_speed_rpm: float
    valve_opening_percent: float
    evaporator_pressure_kpa: float
    superheat_k: float = 20.0
    air_mass_flow_kg_s: float | None = None


TABLE_I = (
    TableRow("low", 25.0, 450.0, 25.0, 302.2),
    TableRow("med", 30.0, 1000.0, 40.0, 251.2),
    TableRow("high", 40.0, 2500.0, 55.0, 204.6),
)
"""The paper's three operating points."""

POINTS = tuple(row.name for row in TABLE_I)
"""Names of the operating points that the loop knows."""

POINT_RANGES = {
    "air_inlet_temperature_c": (10.0, 50.0),
    "compressor_speed_rpm": (100.0, 6000.0),
    "valve_opening_percent": (5.0, 100.0),
    "evaporator_pressure_kpa": (50.0, 800.0),
    "superheat_k": (1.0, 60.0),
    "air_mass_flow_kg_s": (0.02, 0.3),
}
"""What a row of a table of operating points holds beside its name, and the range of each."""
LARGEST_TABLE = 100
"""Most rows of such a table."""


@dataclass(frozen=True)
class Parameters:
    """One parameter set.

    Attributes
    ----------
    refrigerant : str
        "R134a" or "R1234yf".
    array : (len(NAMES),) array
        Values in SI units, read-only, in the order of `NAMES`.
    source : str
        Where the set came from, for messages.
    points : tuple of TableRow
        The operating points that the set was calibrated to; "low", "med" and "high" are among them.
    """

    refrigerant: str
    array: NDArray[np.float64] = field(repr=False)
    source: str = "built in"
    points: tuple[TableRow, ...] = TABLE_I

    def __getitem__(self, name: str) -> float:
        return float(self.array[INDEX[name]])

    def replace(self, refrigerant: str | None = None, **values: float) -> "Parameters":
        """A copy with some values changed."""
        array = self.array.copy()
        for name, value in values.items():
            if name not in INDEX:
                raise ValueError(f"unknown plant parameter {name!r}")
            array[INDEX[name]] = value
        array.setflags(write=False)
        return Parameters(refrigerant or self.refrigerant, array, self.source, self.points)

    @property
    def identity(self) -> str:
        """Hash of refrigerant, values and operating points (16 hex digits)."""
        return digest(self.refrigerant.encode(), self.array.tobytes(), repr(self.points).encode())[:16]


def load_parameters(path: str | Path | None = None) -> Parameters:
    """Read a parameter file.

    Parameters
    ----------
    path : str or Path, optional
        By default the file that the environment variable `PLANT_VARIABLE` names, or else the one shipped with the
        package. In a file of your own an entry may be a plain number in the unit of its name, and what is not there is
        as shipped. Under ``points`` it may hold the operating points, as `load_points` reads them; else they are
        Table I's.

    Raises
    ------
    ValueError
        One line: the entry that is unknown, not a number or outside its range.
    """
    own = path if path is not None else os.environ.get(PLANT_VARIABLE) or None
    shipped = _read_mapping("parameters.yaml", resources.files("ac_plant_node").joinpath("parameters.yaml"))
    source = str(own) if own is not None else "parameters.yaml"
    data = shipped if own is None else _read_mapping(source, Path(own))
    unknown = [key for key in data if key not in NAMES and key not in ("refrigerant", "points")]
    if unknown:
        raise ValueError(f"{source}: unknown parameter {str(unknown[0])[:60]!r}{_nearest(str(unknown[0]), NAMES)}")
    refrigerant = data.get("refrigerant", shipped["refrigerant"])
    if refrigerant not in REFRIGERANTS:
        raise ValueError(f"{source}: refrigerant {str(refrigerant)[:60]!r}, allowed are {', '.join(REFRIGERANTS)}")
    array = np.array([_value(source, name, data.get(name, shipped[name]), shipped[name]) for name in NAMES])
    array.setflags(write=False)
    points: tuple[TableRow, ...] = TABLE_I
    if "points" in data:
        points = _rows(source, data["points"])
        missing = [name for name in POINTS if name not in {row.name for row in points}]
        if missing:
            raise ValueError(f"{source}: points: {missing[0]!r} is missing; the loop runs at {', '.join(POINTS)}")
    return Parameters(str(refrigerant), array, source, points)


def load_points(path: str | Path) -> tuple[TableRow, ...]:
    """Read a table of operating points: YAML with ``points``, a list of rows with the keys of `TableRow`.

    Raises
    ------
    ValueError
        One line: the row and the entry that is missing, unknown, not a number or outside `POINT_RANGES`.
    """
    data = _read_mapping(str(path), Path(path))
    if set(data) != {"points"}:
        strange = next((key for key in data if key != "points"), None)
        what = "'points' is missing" if strange is None else f"unknown key {str(strange)[:60]!r}"
        raise ValueError(f"{path}: {what}; allowed is points, a list of operating points")
    return _rows(str(path), data["points"])


def parameter_text(parameters: Parameters, remarks: Mapping[str, str] | None = None) -> str:
    """A parameter file that `load_parameters` reads back to the last bit, with units, ranges and reasons.

    Parameters
    ----------
    parameters : Parameters
    remarks : mapping, optional
        Reasons to write in place of the shipped ones, for instance where a value was found.
    """
    shipped = _read_mapping("parameters.yaml", resources.files("ac_plant_node").joinpath("parameters.yaml"))
    lines = [f"refrigerant: {parameters.refrigerant}"]
    for name in NAMES:
        entry = shipped[name]
        same = parameters[name] == float(entry["value"])
        reason = (remarks or {}).get(name, entry["reason"] if same else "given")
        words = f"unit: {json.dumps(entry['unit'])}, low: {entry['low']}, high: {entry['high']}"
        lines.append(f"{name}: {{value: {parameters[name]!r}, {words}, reason: {json.dumps(reason)}}}")
    lines.append("points:")
    for row in parameters.points:
        values = {key: getattr(row, key) for key in POINT_RANGES if getattr(row, key) is not None}
        lines.append(f"  - {{name: {json.dumps(row.name)}, {', '.join(f'{k}: {v!r}' for k, v in values.items())}}}")
    return "\n".join(lines) + "\n"


def parameter_range(name: str) -> tuple[float, float]:
    """Lowest and highest value of a parameter."""
    entry = _read_mapping("parameters.yaml", resources.files("ac_plant_node").joinpath("parameters.yaml"))[name]
    return float(entry["low"]), float(entry["high"])


def _read_mapping(source: str, path: "Path | Traversable") -> dict[Any, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{source}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{source}: not a text file in UTF-8") from error
    except (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        # PyYAML's constructors raise more than its own errors: for a date that is none, for nesting without end.
        raise ValueError(f"{source}: not valid YAML ({' '.join(str(error).split())[:200]})") from error
    if not isinstance(data, dict):
        raise ValueError(f"{source}: expected a mapping of names to values")
    return data


def _value(source: str, name: str, entry: Any, shipped: Any) -> float:
    if isinstance(entry, dict):
        unknown = [key for key in entry if key not in shipped]
        if unknown or "value" not in entry:
            what = f"unknown key {str(unknown[0])[:60]!r}" if unknown else "'value' is missing"
            raise ValueError(f"{source}: {name}: {what}; allowed are {', '.join(shipped)}")
        entry = entry["value"]
    value = _number(source, name, entry)
    low, high = float(shipped["low"]), float(shipped["high"])
    if not low <= value <= high:
        raise ValueError(f"{source}: {name} = {value:g} {shipped['unit']} is outside {low:g} to {high:g}")
    return value


def _number(source: str, name: str, entry: Any) -> float:
    try:
        if isinstance(entry, bool):
            raise TypeError
        return float(entry)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{source}: {name} is not a number") from None


def _rows(source: str, entries: Any) -> tuple[TableRow, ...]:
    if not isinstance(entries, list) or not 3 <= len(entries) <= LARGEST_TABLE:
        raise ValueError(f"{source}: points: expected a list of 3 to {LARGEST_TABLE} operating points")
    rows = tuple(_row(f"{source}: points.{number}", entry) for number, entry in enumerate(entries))
    names = [row.name for row in rows]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"{source}: points: {twice[0]!r} is there twice")
    return rows


def _row(where: str, entry: Any) -> TableRow:
    allowed = ("name", *POINT_RANGES)
    if not isinstance(entry, dict):
        raise ValueError(f"{where}: expected a mapping with {', '.join(allowed)}")
    unknown = [key for key in entry if key not in allowed]
    if unknown:
        hint = _nearest(str(unknown[0]), allowed)
        raise ValueError(f"{where}: unknown key {str(unknown[0])[:60]!r}{hint}; allowed are {', '.join(allowed)}")
    name = entry.get("name")
    if not isinstance(name, str) or not name.isidentifier() or len(name) > 40:
        raise ValueError(f"{where}: name must be a word of letters, digits and _, not {str(name)[:60]!r}")
    values = {}
    for key, (low, high) in POINT_RANGES.items():
        if key in entry:
            value = _number(where, key, entry[key])
            if not low <= value <= high:
                raise ValueError(f"{where}: {key} = {value:g} is outside {low:g} to {high:g}")
            values[key] = value
        elif key != "air_mass_flow_kg_s":
            raise ValueError(f"{where}: {key} is missing")
    return TableRow(name, **values)


def _nearest(word: str, known: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(word, known, n=1)
    return f", did you mean {near[0]!r}?" if near else ""


def digest(*parts: bytes) -> str:
    """Hex digest of some bytes, for cache keys."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()
