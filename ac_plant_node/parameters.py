"""Parameters of the plant: read from YAML, checked against their ranges, flat for the compiled code."""

import hashlib
from dataclasses import dataclass, field
from importlib import resources
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
    """

    refrigerant: str
    array: NDArray[np.float64] = field(repr=False)
    source: str = "built in"

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
        return Parameters(refrigerant or self.refrigerant, array, self.source)


def load_parameters(path: str | Path | None = None) -> Parameters:
    """Read a parameter file; the one shipped with the package by default.

    Raises
    ------
    ValueError
        One line: the entry that is missing, unknown, not a number or outside its range.
    """
    source = str(path) if path is not None else "parameters.yaml"
    try:
        text = (
            Path(path).read_text(encoding="utf-8")
            if path is not None
            else resources.files("ac_plant_node").joinpath("parameters.yaml").read_text(encoding="utf-8")
        )
        data = yaml.safe_load(text)
    except OSError as error:
        raise ValueError(f"{source}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{source}: not a text file in UTF-8") from error
    except (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        # PyYAML's constructors raise more than its own errors: for a date that is none, for nesting without end.
        raise ValueError(f"{source}: not valid YAML ({' '.join(str(error).split())[:200]})") from error
    if not isinstance(data, dict):
        raise ValueError(f"{source}: expected a mapping of parameter names")
    unknown = [key for key in data if key not in NAMES and key != "refrigerant"]
    if unknown:
        raise ValueError(f"{source}: unknown parameter {str(unknown[0])[:60]!r}")
    refrigerant = data.get("refrigerant")
    if refrigerant not in REFRIGERANTS:
        raise ValueError(f"{source}: refrigerant {str(refrigerant)[:60]!r}, allowed are {', '.join(REFRIGERANTS)}")
    array = np.array([_value(source, name, data.get(name)) for name in NAMES])
    array.setflags(write=False)
    return Parameters(str(refrigerant), array, source)


def _value(source: str, name: str, entry: Any) -> float:
    if entry is None:
        raise ValueError(f"{source}: parameter {name!r} is missing")
    if not isinstance(entry, dict) or not {"value", "unit", "low", "high", "reason"} <= set(entry):
        raise ValueError(f"{source}: {name} needs value, unit, low, high and reason")
    try:
        value, low, high = (float(entry[key]) for key in ("value", "low", "high"))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{source}: {name} is not a number") from None
    if not low <= value <= high:
        raise ValueError(f"{source}: {name} = {value:g} {entry['unit']} is outside {low:g} to {high:g}")
    return value


def digest(*parts: bytes) -> str:
    """Hex digest of some bytes, for cache keys."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()
