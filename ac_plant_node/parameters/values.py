"""Parameters of the plant, flat for the compiled code. Their files: `ac_plant_node.parameters.file`."""

import hashlib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common import yaml_file

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


POINT_RANGES = {
    "air_inlet_temperature_c": (10.0, 50.0),
    "compressor_speed_rpm": (100.0, 6000.0),
    "valve_opening_percent": (5.0, 100.0),
    "evaporator_pressure_kpa": (50.0, 800.0),
    "superheat_k": (1.0, 60.0),
    "air_mass_flow_kg_s": (0.02, 0.3),
    "condenser_air_mass_flow_kg_s": (0.1, 1.5),
    "condenser_air_inlet_temperature_c": (0.0, 50.0),
    "air_humidity_percent": (0.0, 100.0),
}
"""Entries of a row of a table of operating points beside its name, with the range of each."""


@dataclass(frozen=True)
class TableRow:
    """One measured operating point: air inlet, inputs, and the equilibrium that they lead to.

    Where one of the last four is None, the air flows and the condenser's air are the parameters' nominal ones, and the
    air at the evaporator is dry.
    """

    name: str
    air_inlet_temperature_c: float
    compressor_speed_rpm: float
    valve_opening_percent: float
    evaporator_pressure_kpa: float
    superheat_k: float
    air_mass_flow_kg_s: float | None = None
    condenser_air_mass_flow_kg_s: float | None = field(default=None, repr=False)
    condenser_air_inlet_temperature_c: float | None = field(default=None, repr=False)
    air_humidity_percent: float | None = field(default=None, repr=False)

    @property
    def other_air(self) -> dict[str, float]:
        """Return what the row gives of the condenser's air and of humidity, by the names of the fields."""
        names = ("condenser_air_mass_flow_kg_s", "condenser_air_inlet_temperature_c", "air_humidity_percent")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


TABLE_I = (
    TableRow("low", 25.0, 450.0, 25.0, 302.2, 20.0),
    TableRow("med", 30.0, 1000.0, 40.0, 251.2, 20.0),
    TableRow("high", 40.0, 2500.0, 55.0, 204.6, 20.0),
)
"""The paper's three operating points."""

POINTS = tuple(row.name for row in TABLE_I)
"""Names of the operating points that the loop knows."""

LARGEST_TABLE = 100
"""Largest number of rows of a table of operating points."""


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

    @property
    def values(self) -> NDArray[np.float64]:
        """Return the values in an array of the caller's own: for read-only ones all would be compiled a second time."""
        return self.array.copy()

    def __getitem__(self, name: str) -> float:
        return float(self.array[INDEX[name]])

    def replace(self, refrigerant: str | None = None, **values: float) -> "Parameters":
        """Return a copy with some values changed."""
        array = self.array.copy()
        for name, value in values.items():
            if name not in INDEX:
                raise ValueError(f"unknown plant parameter {name!r}")
            array[INDEX[name]] = value
        array.setflags(write=False)
        return Parameters(refrigerant or self.refrigerant, array, self.source, self.points)

    @property
    def identity(self) -> str:
        """Return a hash of refrigerant, values and operating points (16 hex digits)."""
        # Other air counts where a row gives it: whoever gives none can replay all recordings with these values.
        other_air = [repr((row.name, row.other_air)).encode() for row in self.points if row.other_air]
        return digest(self.refrigerant.encode(), self.array.tobytes(), repr(self.points).encode(), *other_air)[:16]


def parameter_range(name: str) -> tuple[float, float]:
    """Return lowest and highest value of a parameter."""
    entry = shipped()[name]
    return float(entry["low"]), float(entry["high"])


@cache
def shipped() -> dict[str, Any]:
    """Return the content of the shipped file: value, unit, range and reason of every parameter."""
    return dict(yaml_file.shipped(Path(__file__).with_name("parameters.yaml")))


def digest(*parts: bytes) -> str:
    """Return a hex digest of some bytes, for cache keys."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()
