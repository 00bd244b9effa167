"""Schema of the parameter files and tables of operating points that users write, with one-line errors."""

from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from ac_common.errors import UserError, nearest, shortened
from ac_common.yaml_file import parsed, text_of
from ac_plant_node.parameters.values import (
    LARGEST_TABLE,
    NAMES,
    POINT_RANGES,
    POINTS,
    TABLE_I,
    TableRow,
    parameter_range,
    shipped,
)
from ac_plant_node.properties.tables import REFRIGERANTS


def checked_plant(path: Path) -> tuple[str, dict[str, float], tuple[TableRow, ...]]:
    """Return refrigerant, values of all parameters and operating points of a parameter file.

    Raises
    ------
    ValueError
        One line: the entry that is unknown, not a number or outside its range.
    """
    file = _validated(path, _plant_schema())
    return file.refrigerant, {name: getattr(file, name) for name in NAMES}, _table(file.points)


def checked_points(path: Path) -> tuple[TableRow, ...]:
    """Return the operating points of a table's file; raises as `checked_plant`."""
    return _table(_validated(path, _TableFile).points)


def _read_mapping(path: Path) -> dict[str, Any]:
    data = parsed(text_of(path), f"{path}: not valid YAML")
    if not isinstance(data, dict):
        raise UserError(f"{path}: expected a mapping of names to values")
    return {str(key): value for key, value in data.items()}


def _word(name: str) -> str:
    if not name.isidentifier() or len(name) > 40:
        raise ValueError(f"must be a word of letters, digits and _, not {shortened(name)!r}")
    return name


def _point(key: str) -> Any:
    """Return the schema of one entry of an operating point."""
    low, high = POINT_RANGES[key]
    return Field(ge=low, le=high, strict=True)


class _Row(BaseModel):
    """A `TableRow` as it is written."""

    model_config = ConfigDict(extra="forbid")
    name: Annotated[str, AfterValidator(_word)]
    air_inlet_temperature_c: Annotated[float, _point("air_inlet_temperature_c")]
    compressor_speed_rpm: Annotated[float, _point("compressor_speed_rpm")]
    valve_opening_percent: Annotated[float, _point("valve_opening_percent")]
    evaporator_pressure_kpa: Annotated[float, _point("evaporator_pressure_kpa")]
    superheat_k: Annotated[float, _point("superheat_k")]
    air_mass_flow_kg_s: Annotated[float, _point("air_mass_flow_kg_s")] | None = None
    condenser_air_mass_flow_kg_s: Annotated[float, _point("condenser_air_mass_flow_kg_s")] | None = None
    condenser_air_inlet_temperature_c: Annotated[float, _point("condenser_air_inlet_temperature_c")] | None = None
    air_humidity_percent: Annotated[float, _point("air_humidity_percent")] | None = None


def _table(rows: tuple[_Row, ...]) -> tuple[TableRow, ...]:
    return tuple(TableRow(**row.model_dump()) for row in rows)


def _known_refrigerant(name: str) -> str:
    if name not in REFRIGERANTS:
        raise ValueError(f"{shortened(name)!r}, allowed are {', '.join(REFRIGERANTS)}")
    return name


def _distinct(rows: tuple[_Row, ...]) -> tuple[_Row, ...]:
    names = [row.name for row in rows]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"{twice[0]!r} is there twice")
    return rows


def _for_the_loop(rows: tuple[_Row, ...]) -> tuple[_Row, ...]:
    missing = [name for name in POINTS if name not in {row.name for row in rows}]
    if missing:
        raise ValueError(f"{missing[0]!r} is missing; the loop runs at {', '.join(POINTS)}")
    return rows


_Rows = Annotated[tuple[_Row, ...], Field(min_length=3, max_length=LARGEST_TABLE), AfterValidator(_distinct)]


class _TableFile(BaseModel):
    """A table of operating points."""

    model_config = ConfigDict(extra="forbid")
    points: _Rows


class _PlantFile(BaseModel):
    """Entries of a parameter file beside the numbers of `NAMES`."""

    model_config = ConfigDict(extra="forbid")
    refrigerant: Annotated[str, AfterValidator(_known_refrigerant)] = "R134a"
    points: Annotated[_Rows, AfterValidator(_for_the_loop)] = tuple(_Row(**asdict(row)) for row in TABLE_I)


def _plain(known: Mapping[str, Any]) -> BeforeValidator:
    """Return a validator that takes the number out of the long form ``{value: .., unit: .., ...}``."""

    def number(entry: Any) -> Any:
        if not isinstance(entry, dict):
            return entry
        unknown = [key for key in entry if key not in known]
        if unknown or "value" not in entry:
            what = f"unknown key {shortened(unknown[0])!r}" if unknown else "'value' is missing"
            raise ValueError(f"{what}; allowed are {', '.join(known)}")
        if entry.get("unit", known["unit"]) != known["unit"]:
            raise ValueError(f"unit {shortened(entry['unit'])!r}; the value must be in {known['unit']}")
        return entry["value"]

    return BeforeValidator(number)


@cache
def _plant_schema() -> type[_PlantFile]:
    """Return the schema of a parameter file: all entries optional, ranges and defaults those of the shipped file."""
    known = shipped()
    fields: dict[str, Any] = {
        name: (
            Annotated[float, _plain(known[name]), Field(ge=known[name]["low"], le=known[name]["high"], strict=True)],
            float(known[name]["value"]),
        )
        for name in NAMES
    }
    return create_model("PlantFile", __base__=_PlantFile, **fields)


def _validated[M: BaseModel](path: Path, schema: type[M]) -> M:
    data = _read_mapping(path)
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{path}: {_line(error.errors(include_url=False)[0], tuple(schema.model_fields))}") from None


def _line(problem: Any, top: tuple[str, ...]) -> str:
    """Return one of pydantic's errors in the words of this project: where, what was given, what is allowed."""
    *above, key = [str(part) for part in problem["loc"]]
    kind, given = problem["type"], problem["input"]
    inside = f"{'.'.join(above)}: " if above else ""
    row = ("name", *POINT_RANGES)
    if kind == "value_error":
        return f"{inside}{key}: {problem['ctx']['error']}"
    if kind == "extra_forbidden":
        known = row if above else top
        listed = f"; allowed are {', '.join(known)}" if len(known) < len(NAMES) else ""
        return f"{inside}unknown key {shortened(key)!r}{nearest(key, known, otherwise='')}{listed}"
    if kind == "missing":
        return f"{inside}{key} is missing"
    if kind.startswith(("float", "finite")):
        return f"{inside}{key} is not a number"
    if kind in ("greater_than_equal", "less_than_equal"):
        low, high = POINT_RANGES[key] if above else parameter_range(key)
        unit = "" if above else f" {shipped()[key]['unit']}"
        number = shortened(given["value"] if isinstance(given, dict) else given)
        return f"{inside}{key} = {number}{unit} is outside {low:g} to {high:g}"
    if kind.startswith(("tuple", "too_")):
        return f"{inside}{key}: expected a list of 3 to {LARGEST_TABLE} operating points"
    if kind.startswith("model"):
        return f"{inside}{key}: expected a mapping with {', '.join(row)}".replace("points: ", "points.")
    return f"{inside}{key}: {problem['msg']}"
