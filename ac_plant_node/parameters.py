"""Parameters of the plant: read from YAML, checked against their ranges, flat for the compiled code."""

import difflib
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from ac_plant_node.tables import REFRIGERANTS
from bringup.errors import shortened
from bringup.yaml_file import parsed, text_of

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


POINT_RANGES = {
    "air_inlet_temperature_c": (10.0, 50.0),
    "compressor_speed_rpm": (100.0, 6000.0),
    "valve_opening_percent": (5.0, 100.0),
    "evaporator_pressure_kpa": (50.0, 800.0),
    "superheat_k": (1.0, 60.0),
    "air_mass_flow_kg_s": (0.02, 0.3),
}
"""What a row of a table of operating points holds beside its name, and the range of each."""


def _word(name: str) -> str:
    if not name.isidentifier() or len(name) > 40:
        raise ValueError(f"must be a word of letters, digits and _, not {shortened(name)!r}")
    return name


def _point(key: str) -> Any:
    """Schema of one entry of an operating point."""
    low, high = POINT_RANGES[key]
    return Field(ge=low, le=high, strict=True)


@dataclass(frozen=True)
class TableRow:
    """One operating point as it was measured: air inlet, inputs, and the rest they lead to.

    The air flow is the nominal one of the parameters where `air_mass_flow_kg_s` is None.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    name: Annotated[str, AfterValidator(_word)]
    air_inlet_temperature_c: Annotated[float, _point("air_inlet_temperature_c")]
    compressor_speed_rpm: Annotated[float, _point("compressor_speed_rpm")]
    valve_opening_percent: Annotated[float, _point("valve_opening_percent")]
    evaporator_pressure_kpa: Annotated[float, _point("evaporator_pressure_kpa")]
    superheat_k: Annotated[float, _point("superheat_k")]
    air_mass_flow_kg_s: Annotated[float, _point("air_mass_flow_kg_s")] | None = None


TABLE_I = (
    TableRow("low", 25.0, 450.0, 25.0, 302.2, 20.0),
    TableRow("med", 30.0, 1000.0, 40.0, 251.2, 20.0),
    TableRow("high", 40.0, 2500.0, 55.0, 204.6, 20.0),
)
"""The paper's three operating points."""

POINTS = tuple(row.name for row in TABLE_I)
"""Names of the operating points that the loop knows."""

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
    source = str(own) if own is not None else "parameters.yaml"
    file = _validated(source, {} if own is None else _read_mapping(Path(own)), _plant_schema())
    array = np.array([getattr(file, name) for name in NAMES])
    array.setflags(write=False)
    return Parameters(file.refrigerant, array, source, file.points)


def load_points(path: str | Path) -> tuple[TableRow, ...]:
    """Read a table of operating points: YAML with ``points``, a list of rows with the keys of `TableRow`.

    Raises
    ------
    ValueError
        One line: the row and the entry that is missing, unknown, not a number or outside `POINT_RANGES`.
    """
    return _validated(str(path), _read_mapping(Path(path)), _TableFile).points


def parameter_text(parameters: Parameters, remarks: Mapping[str, str] | None = None) -> str:
    """A parameter file that `load_parameters` reads back to the last bit, with units, ranges and reasons.

    Parameters
    ----------
    parameters : Parameters
    remarks : mapping, optional
        Reasons to write in place of the shipped ones, for instance where a value was found.
    """
    shipped = _shipped()
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
    entry = _shipped()[name]
    return float(entry["low"]), float(entry["high"])


# --------------------------------------------------------------------------------------------- files and their schema


def _read_mapping(path: Path) -> dict[str, Any]:
    data = parsed(text_of(path), f"{path}: not valid YAML")
    if not isinstance(data, dict):
        raise ValueError(f"{path}: expected a mapping of names to values")
    return {str(key): value for key, value in data.items()}


@cache
def _shipped() -> dict[str, Any]:
    """The shipped file: of every parameter the value, unit, range and reason."""
    return _read_mapping(Path(__file__).with_name("parameters.yaml"))


def _known_refrigerant(name: str) -> str:
    if name not in REFRIGERANTS:
        raise ValueError(f"{shortened(name)!r}, allowed are {', '.join(REFRIGERANTS)}")
    return name


def _distinct(rows: tuple[TableRow, ...]) -> tuple[TableRow, ...]:
    names = [row.name for row in rows]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"{twice[0]!r} is there twice")
    return rows


def _for_the_loop(rows: tuple[TableRow, ...]) -> tuple[TableRow, ...]:
    missing = [name for name in POINTS if name not in {row.name for row in rows}]
    if missing:
        raise ValueError(f"{missing[0]!r} is missing; the loop runs at {', '.join(POINTS)}")
    return rows


_Rows = Annotated[tuple[TableRow, ...], Field(min_length=3, max_length=LARGEST_TABLE), AfterValidator(_distinct)]


class _TableFile(BaseModel):
    """A table of operating points."""

    model_config = ConfigDict(extra="forbid")
    points: _Rows


class _PlantFile(BaseModel):
    """What a parameter file holds beside the numbers of `NAMES`."""

    model_config = ConfigDict(extra="forbid")
    refrigerant: Annotated[str, AfterValidator(_known_refrigerant)] = "R134a"
    points: Annotated[_Rows, AfterValidator(_for_the_loop)] = TABLE_I


def _plain(shipped: Mapping[str, Any]) -> BeforeValidator:
    """Takes the number out of the long form ``{value: .., unit: .., ...}``."""

    def number(entry: Any) -> Any:
        if not isinstance(entry, dict):
            return entry
        unknown = [key for key in entry if key not in shipped]
        if unknown or "value" not in entry:
            what = f"unknown key {shortened(unknown[0])!r}" if unknown else "'value' is missing"
            raise ValueError(f"{what}; allowed are {', '.join(shipped)}")
        if entry.get("unit", shipped["unit"]) != shipped["unit"]:
            raise ValueError(f"unit {shortened(entry['unit'])!r}; the value must be in {shipped['unit']}")
        return entry["value"]

    return BeforeValidator(number)


@cache
def _plant_schema() -> type[_PlantFile]:
    """A parameter file: every entry may be left out, its range and its default are those of the shipped file."""
    shipped = _shipped()
    fields: dict[str, Any] = {
        name: (
            Annotated[
                float, _plain(shipped[name]), Field(ge=shipped[name]["low"], le=shipped[name]["high"], strict=True)
            ],
            float(shipped[name]["value"]),
        )
        for name in NAMES
    }
    return create_model("PlantFile", __base__=_PlantFile, **fields)


def _validated[M: BaseModel](source: str, data: dict[str, Any], schema: type[M]) -> M:
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{source}: {_line(error.errors(include_url=False)[0], tuple(schema.model_fields))}") from None


def _line(problem: Any, top: tuple[str, ...]) -> str:
    """One of pydantic's problems in the words of this project: where, what was given, what is allowed."""
    *above, key = [str(part) for part in problem["loc"]]
    kind, given = problem["type"], problem["input"]
    inside = f"{'.'.join(above)}: " if above else ""
    row = ("name", *POINT_RANGES)
    if kind == "value_error":
        return f"{inside}{key}: {problem['ctx']['error']}"
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        known = row if above else top
        listed = f"; allowed are {', '.join(known)}" if len(known) < len(NAMES) else ""
        return f"{inside}unknown key {shortened(key)!r}{_nearest(key, known)}{listed}"
    if kind == "missing":
        return f"{inside}{key} is missing"
    if kind.startswith(("float", "finite")):
        return f"{inside}{key} is not a number"
    if kind in ("greater_than_equal", "less_than_equal"):
        low, high = POINT_RANGES[key] if above else parameter_range(key)
        unit = "" if above else f" {_shipped()[key]['unit']}"
        number = shortened(given["value"] if isinstance(given, dict) else given)
        return f"{inside}{key} = {number}{unit} is outside {low:g} to {high:g}"
    if kind.startswith(("tuple", "too_")):
        return f"{inside}{key}: expected a list of 3 to {LARGEST_TABLE} operating points"
    if kind.startswith("dataclass"):
        return f"{inside}{key}: expected a mapping with {', '.join(row)}".replace("points: ", "points.")
    return f"{inside}{key}: {problem['msg']}"


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
